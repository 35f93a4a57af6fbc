// Scale-invariant features and the views' geometry that OpenCV finds from them. See src/bridge/vision.rs for
// shapes and conventions.
#pragma once

#include <cstddef>
#include <cstdint>

#include "rust/cxx.h"

namespace spba::vision {

struct DetectOptions;
struct Feature;
struct Found;

// All throw std::exception where sizes do not match or OpenCV refuses.
rust::Vec<Feature> detect(rust::Slice<const std::uint8_t> gray, rust::Slice<const std::uint8_t> mask,
                          std::size_t width, std::size_t height, const DetectOptions& options,
                          rust::Vec<float>& descriptors);
Found two_views(rust::Slice<const double> a, rust::Slice<const double> b, double threshold,
                rust::Slice<std::uint8_t> inliers);
Found resect(rust::Slice<const double> points, rust::Slice<const double> rays, double threshold,
             rust::Slice<std::uint8_t> inliers);

}  // namespace spba::vision
