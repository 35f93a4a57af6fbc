// Image resampling with OpenCV, for undistortion. See src/bridge/vision.rs for shapes and conventions.
#pragma once

#include <cstddef>
#include <cstdint>

#include "rust/cxx.h"

namespace spba::vision {

enum class Sampling : ::std::uint8_t;

// Throws std::exception where the sizes do not match or OpenCV refuses.
void remap(rust::Slice<const float> source, std::size_t width, std::size_t height, std::size_t channels,
           rust::Slice<const float> map_x, rust::Slice<const float> map_y, Sampling sampling,
           rust::Slice<float> target);

}  // namespace spba::vision
