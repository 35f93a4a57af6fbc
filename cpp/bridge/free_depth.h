// Classic photometric bundle adjustment: a free inverse depth per pixel. See src/bridge/bundle.rs for shapes
// and conventions.
#pragma once

#include "rust/cxx.h"

namespace spba {

struct FreePixel;
struct PhotometricOptions;

// Throws std::exception where indices or sizes do not fit, or where Ceres finds no usable solution.
void adjust_photometric(rust::Slice<double> cameras, rust::Vec<FreePixel>& pixels,
                        rust::Slice<const float> images, const PhotometricOptions& options);

}  // namespace spba
