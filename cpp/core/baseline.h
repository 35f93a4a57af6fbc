// What classic bundle adjustment cannot know: where the world is, and how large.
#pragma once

#include <ceres/ceres.h>

#include <cstddef>

namespace spba {

// `cameras`: camera_from_world[6], one after another. The first is the frame of the world, its distance to
// the second the unit of length.
inline void HoldGauge(ceres::Problem& problem, double* cameras, std::size_t count) {
  if (problem.HasParameterBlock(cameras)) problem.SetParameterBlockConstant(cameras);
  if (count > 1 && problem.HasParameterBlock(cameras + 6)) {
    using Baseline = ceres::ProductManifold<ceres::EuclideanManifold<3>, ceres::SphereManifold<3>>;
    problem.SetManifold(cameras + 6, new Baseline);
  }
}

}  // namespace spba
