// Masks with OpenCV: GrabCut and what cleans its result. See src/bridge/vision.rs for shapes and conventions.
#pragma once

#include <cstddef>
#include <cstdint>

#include "rust/cxx.h"

namespace spba::vision {

struct Picture;
struct Colours;

// All throw std::exception where sizes do not match or OpenCV refuses.
void grab_cut(const Picture& picture, rust::Slice<std::uint8_t> labels, Colours& colours, bool learn,
              std::size_t iterations);
void clean(rust::Slice<std::uint8_t> mask, std::size_t width, std::size_t height, std::size_t radius);
rust::Vec<std::uint16_t> parts(rust::Slice<const std::uint8_t> mask, std::size_t width, std::size_t height,
                               std::size_t radius);
void grow(rust::Slice<std::uint8_t> mask, std::size_t width, std::size_t height, std::int32_t by);

}  // namespace spba::vision
