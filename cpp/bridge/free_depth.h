// Classic photometric bundle adjustment: a free inverse depth per pixel. See src/bridge/bundle.rs for shapes
// and conventions.
#pragma once

#include "rust/cxx.h"

namespace spba {
namespace bridge {

struct FreePixel;
struct PhotometricOptions;

// Both throw std::exception where indices or sizes do not fit, the first also where Ceres finds no usable
// solution.
void adjust_photometric(rust::Slice<double> cameras, rust::Vec<FreePixel>& pixels,
                        rust::Slice<const float> images, const PhotometricOptions& options);
void adjust_pixel_depths(rust::Slice<const double> cameras, rust::Vec<FreePixel>& pixels,
                         rust::Slice<const float> images, const PhotometricOptions& options);

}  // namespace bridge
}  // namespace spba
