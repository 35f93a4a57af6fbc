#include "bridge/bundle.h"

#include <ceres/ceres.h>

#include <stdexcept>

#include "core/baseline.h"
#include "core/posed_cameras.h"
#include "core/reprojection_block.h"
#include "spba-ceres/src/bridge/bundle.rs.h"
#include "spba/reprojection.h"

namespace spba {
namespace bridge {

double adjust(Bundle& bundle, const BundleOptions& options) {
  const std::size_t cameras = bundle.cameras.size() / 6, points = bundle.points.size() / 3;
  if (cameras == 0 || bundle.cameras.size() % 6 != 0 || bundle.points.size() % 3 != 0) {
    throw std::invalid_argument("six numbers a camera and three a point are needed");
  }
  const Pinhole camera{options.fx, options.fy, options.cx, options.cy};
  PosedCameras posed(bundle.cameras.data(), cameras);
  ceres::CauchyLoss loss(options.loss_width);
  ceres::Problem::Options settings;
  settings.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  settings.evaluation_callback = &posed;
  ceres::Problem problem(settings);
  for (const auto& seen : bundle.observations) {
    if (seen.camera >= cameras || seen.point >= points)
      throw std::invalid_argument("no such camera or point");
    problem.AddResidualBlock(new ReprojectionBlock(posed, seen.camera, camera, {seen.x, seen.y}), &loss,
                             &bundle.cameras[6 * seen.camera], &bundle.points[3 * seen.point], &bundle.zoom);
  }
  if (bundle.observations.empty()) throw std::invalid_argument("no observation");
  if (options.zoom_deviation > 0.0) {
    problem.AddResidualBlock(ZoomPrior::Create(options.zoom_deviation), nullptr, &bundle.zoom);
  } else {
    problem.SetParameterBlockConstant(&bundle.zoom);
  }
  if (cameras > 1) HoldGauge(problem, &bundle.cameras[0], &bundle.cameras[6]);
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::DENSE_SCHUR;
  solver.max_num_iterations = static_cast<int>(options.max_iterations);
  solver.num_threads = 1;
  solver.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  if (!summary.IsSolutionUsable()) throw std::runtime_error(summary.message);
  return summary.final_cost;
}

}  // namespace bridge
}  // namespace spba
