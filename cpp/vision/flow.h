// Carrying a map from one picture to another by optical flow. See src/bridge/vision.rs for shapes and
// conventions.
#pragma once

#include <cstdint>

#include "rust/cxx.h"

namespace spba::vision {

struct Picture;

// Throws std::exception where sizes do not match or OpenCV refuses.
rust::Vec<std::uint8_t> carried(rust::Slice<const std::uint8_t> map, const Picture& from, const Picture& to);

}  // namespace spba::vision
