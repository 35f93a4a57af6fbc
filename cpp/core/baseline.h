// What classic bundle adjustment cannot know: where the world is, and how large.
#pragma once

#include <ceres/ceres.h>

#include <algorithm>
#include <stdexcept>
#include <vector>

#include "core/geometry.h"
#include "spba/reprojection.h"

namespace spba {

// The centre of a camera, in the world.
inline Vector3 Centre(const double* camera_from_world) {
  return -RotationFromTwist(Vector3(camera_from_world)).transpose() * Vector3(camera_from_world + 3);
}

// Of cameras, camera_from_world[6] each, the one farthest from the first.
inline double* FarthestFromFirst(const std::vector<double*>& cameras) {
  const Vector3 first = Centre(cameras.front());
  const auto nearer = [&](const double* a, const double* b) {
    return (Centre(a) - first).norm() < (Centre(b) - first).norm();
  };
  return *std::max_element(cameras.begin(), cameras.end(), nearer);
}

// The camera `first` stays where it is, and the `other` as far from it; neither need be in `problem`. Both
// are camera_from_world[6].
inline void HoldGauge(ceres::Problem& problem, double* first, double* other) {
  if (problem.HasParameterBlock(first)) problem.SetParameterBlockConstant(first);
  if (other == first || !problem.HasParameterBlock(other)) return;
  const Vector3 centre = Centre(first);
  const double baseline = (Centre(other) - centre).norm();
  if (!(baseline > 0.0)) throw std::invalid_argument("the second camera stands where the first does");
  problem.AddResidualBlock(DistancePrior::Create(centre.data(), baseline), nullptr, other);
}

}  // namespace spba
