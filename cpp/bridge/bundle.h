// Classic bundle adjustment of features. See src/bridge/bundle.rs for shapes and conventions.
#pragma once

#include "rust/cxx.h"

namespace spba {
namespace bridge {

struct Bundle;
struct BundleOptions;

// Throws std::exception where indices or sizes do not fit, or where Ceres finds no usable solution.
double adjust(Bundle& bundle, const BundleOptions& options);

}  // namespace bridge
}  // namespace spba
