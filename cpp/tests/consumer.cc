// What a C++ SfM stack does with include/spba: adds our terms to its own ceres::Problem. Here two poses and
// known points; the silhouette correspondences are exact, so the motion and alpha must come out exactly.
#include <ceres/ceres.h>

#include <cmath>
#include <cstdio>

#include "spba/inverse_depth.h"
#include "spba/silhouette.h"

int main() {
  const spba::Pinhole camera{500.0, 500.0, 320.0, 240.0};
  const double p0[6] = {0.1, -0.5, 0.05, 0.1, 0.0, 2.0};
  const double true_motion[6] = {0.02, 0.2, -0.03, 0.05, -0.02, 0.1};
  double target[6], motion[6] = {0, 0, 0, 0, 0, 0};
  std::copy(p0, p0 + 6, target);

  double points[8][3];
  double alpha = 0.4;
  ceres::Problem problem;
  for (int i = 0; i < 8; ++i) {
    for (int axis = 0; axis < 3; ++axis) points[i][axis] = (i >> axis) & 1 ? 0.3 : -0.2;
    double in_source[3], pixel[2];
    spba::PointInSource(p0, true_motion, points[i], in_source);
    spba::Project(camera, in_source, pixel);
    problem.AddResidualBlock(spba::SilhouetteCost::Create({camera, {pixel[0], pixel[1]}, 0.0}), nullptr,
                             target, motion, points[i]);
    problem.AddResidualBlock(
        spba::InverseDepthCost::Create({camera, {pixel[0], pixel[1]}, 0.5 / in_source[2], {0.0, 0.0}}),
        new ceres::HuberLoss(10.0), target, motion, points[i], &alpha);
    problem.SetParameterBlockConstant(points[i]);
  }
  problem.SetParameterBlockConstant(target);

  ceres::Solver::Options options;
  options.function_tolerance = 1e-16;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  double error = 0.0;
  for (int i = 0; i < 6; ++i) error = std::max(error, std::abs(motion[i] - true_motion[i]));
  error = std::max(error, std::abs(alpha - 0.5));
  std::printf("largest error of the motion and the scale: %.1e\n", error);
  return error < 1e-6 ? 0 : 1;
}
