// What classic bundle adjustment cannot know: where the world is, and how large.
#pragma once

#include <ceres/ceres.h>

#include <cmath>
#include <cstddef>
#include <stdexcept>

#include "spba/reprojection.h"

namespace spba {

// `cameras`: camera_from_world[6], one after another, those that see something in `problem`. The first is the
// frame of the world, its distance to the second the unit of length.
inline void HoldGauge(ceres::Problem& problem, double* cameras, std::size_t count) {
  if (problem.HasParameterBlock(cameras)) problem.SetParameterBlockConstant(cameras);
  double* const second = cameras + 6;
  if (count < 2 || !problem.HasParameterBlock(second)) return;
  const double baseline = std::hypot(second[3], second[4], second[5]);
  if (!(baseline > 0.0)) throw std::invalid_argument("the second camera stands where the first does");
  problem.AddResidualBlock(BaselinePrior::Create(baseline), nullptr, second);
}

}  // namespace spba
