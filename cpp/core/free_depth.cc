#include "core/free_depth.h"

#include <ceres/ceres.h>
#include <ceres/jet.h>

#include <cmath>
#include <memory>
#include <stdexcept>

#include "core/baseline.h"

namespace spba {
namespace {

constexpr int kPatch = FreeDepthCost::kPatch;
constexpr int kColours = 3 * kPatch;

// What is known of each colour of a patch: its derivative by the inverse depth, by a turn of the world about
// the source's axes and by a shift along them; last, its residual.
enum Column { kDepth = 0, kTurn = 1, kShift = 4, kResidual = 7, kColumns = 8 };

using PatchRows = Eigen::Matrix<double, kColours, kColumns>;
using Triangle = Eigen::Matrix<double, kColumns, kColumns>;

template <int kSize>
using BlockJacobian = Eigen::Matrix<double, kColumns, kSize, Eigen::RowMajor>;

// Upper triangular R of rows = Q R, by modified Gram-Schmidt: R^T R = rows^T rows. A Cholesky factor of the
// product would be wrong, for the columns are nearly dependent: a small patch hardly tells a turn from a
// shift.
Triangle Triangular(PatchRows rows) {
  Triangle triangle = Triangle::Zero();
  for (int k = 0; k < kColumns; ++k) {
    triangle(k, k) = rows.col(k).norm();
    if (triangle(k, k) == 0.0) continue;
    rows.col(k) /= triangle(k, k);
    for (int column = k + 1; column < kColumns; ++column) {
      triangle(k, column) = rows.col(k).dot(rows.col(column));
      rows.col(column) -= triangle(k, column) * rows.col(k);
    }
  }
  return triangle;
}

}  // namespace

FreeDepthCameras::FreeDepthCameras(const Pinhole& intrinsics, const double* twists,
                                   const std::deque<ImageSampler>& images)
    : PosedCameras(twists, images.size()), intrinsics_(intrinsics), images_(images) {}

FreeDepthPatch::FreeDepthPatch(const FreeDepthCameras& cameras, std::uint32_t target, double x, double y)
    : target(target), x(x), y(y) {
  for (int k = 0; k < kPatch; ++k) {
    const double pixel[] = {x + FreeDepthCost::kSteps[k][0], y + FreeDepthCost::kSteps[k][1]};
    cameras.image(target).Sample(pixel, colours.data() + 3 * k);
  }
  SubtractPatchMean(colours);
}

bool FreeDepthBlock::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  const double inverse_depth = parameters[2][0], depth = 1.0 / inverse_depth;
  if (!(inverse_depth > 0.0 && depth > kMinDepth)) return false;
  const Pinhole& camera = cameras_.intrinsics();
  const PointColour colour{camera, &cameras_.image(source_)};
  const FreeDepthCameras::PosedCamera& target = cameras_.posed(patch_.target);
  const FreeDepthCameras::PosedCamera& source = cameras_.posed(source_);
  const Matrix3 source_from_target =
      source.camera_from_world.rotation * target.camera_from_world.rotation.transpose();
  const Vector3 target_in_source =
      source.camera_from_world.translation - source_from_target * target.camera_from_world.translation;

  Eigen::Map<Eigen::Matrix<double, kColumns, 1>> residual(residuals);
  FreeDepthPatch::Colours colours;
  const bool cameras_move = jacobians != nullptr && (jacobians[0] != nullptr || jacobians[1] != nullptr);
  PatchRows rows = PatchRows::Zero();
  for (int k = 0; k < kPatch; ++k) {
    const Vector3 direction = source_from_target * PatchRay(camera, patch_.x, patch_.y, k);
    const Vector3 in_source = depth * direction + target_in_source;
    if (jacobians == nullptr) {
      if (!colour(in_source.data(), colours.data() + 3 * k)) return false;
      continue;
    }
    ceres::Jet<double, 3> point[3], rgb[3];
    for (int i = 0; i < 3; ++i) point[i] = ceres::Jet<double, 3>(in_source[i], i);
    if (!colour(point, rgb)) return false;
    const Vector3 turned = in_source - source.camera_from_world.translation;
    for (int channel = 0; channel < 3; ++channel) {
      const auto& by_point = rgb[channel].v;
      auto row = rows.row(3 * k + channel);
      row[kDepth] = -depth * depth * by_point.dot(direction);
      if (cameras_move) {
        // by_point (turn x turned) = (turned x by_point) turn.
        row.segment<3>(kTurn) = turned.cross(by_point);
        row.segment<3>(kShift) = by_point;
      }
      row[kResidual] = rgb[channel].a;
    }
  }
  if (jacobians == nullptr) {
    SubtractPatchMean(colours);
    residual.setZero();
    residual[kResidual] = (patch_.colours - colours).norm();
    return true;
  }
  SubtractPatchMean(rows);
  rows.col(kResidual) -= patch_.colours;
  rows = -rows;
  const Triangle triangle = Triangular(rows);
  residual = triangle.col(kResidual);
  if (jacobians[0] != nullptr) {
    Eigen::Map<BlockJacobian<6>> by_target(jacobians[0]);
    by_target.leftCols<3>() = -triangle.middleCols<3>(kTurn) * (source_from_target * target.left_jacobian);
    by_target.rightCols<3>() = -triangle.middleCols<3>(kShift) * source_from_target;
  }
  if (jacobians[1] != nullptr) {
    Eigen::Map<BlockJacobian<6>> by_source(jacobians[1]);
    by_source.leftCols<3>() = triangle.middleCols<3>(kTurn) * source.left_jacobian;
    by_source.rightCols<3>() = triangle.middleCols<3>(kShift);
  }
  if (jacobians[2] != nullptr) {
    Eigen::Map<Eigen::Matrix<double, kColumns, 1>>{jacobians[2]} = triangle.col(kDepth);
  }
  return true;
}

void CheckCameras(const std::vector<double>& twists, const std::vector<FreeDepthPixel>& pixels,
                  const std::deque<ImageSampler>& images) {
  if (twists.size() != 6 * images.size()) {
    throw std::invalid_argument("six numbers and one image a camera are needed");
  }
  for (const FreeDepthPixel& pixel : pixels) {
    bool fits = pixel.target < images.size();
    for (const std::uint32_t source : pixel.sources) {
      fits = fits && source < images.size() && source != pixel.target;
    }
    if (!fits) throw std::invalid_argument("no such camera");
  }
}

void AdjustFreeDepth(std::vector<double>& twists, std::vector<FreeDepthPixel>& pixels,
                     const std::deque<ImageSampler>& images, const FreeDepthOptions& options) {
  CheckCameras(twists, pixels, images);
  FreeDepthCameras cameras(options.intrinsics, twists.data(), images);
  ceres::HuberLoss loss(options.loss_width * std::sqrt(double{kColours}));
  ceres::Problem::Options ownership;
  ownership.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ownership.evaluation_callback = &cameras;
  ceres::Problem problem(ownership);
  const auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (FreeDepthPixel& pixel : pixels) {
    const FreeDepthPatch patch(cameras, pixel.target, pixel.x, pixel.y);
    for (const std::uint32_t source : pixel.sources) {
      problem.AddResidualBlock(new FreeDepthBlock(cameras, patch, source), &loss, &twists[6 * pixel.target],
                               &twists[6 * source], &pixel.inverse_depth);
      ordering->AddElementToGroup(&pixel.inverse_depth, 0);
    }
  }
  if (problem.NumResidualBlocks() == 0) return;
  std::vector<double*> seeing;
  for (std::size_t camera = 0; camera < images.size(); ++camera) {
    double* const twist = &twists[6 * camera];
    if (!problem.HasParameterBlock(twist)) continue;
    ordering->AddElementToGroup(twist, 1);
    seeing.push_back(twist);
  }
  HoldGauge(problem, seeing.front(), FarthestFromFirst(seeing));
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::DENSE_SCHUR;
  solver.linear_solver_ordering = ordering;
  solver.max_num_iterations = options.max_iterations;
  solver.num_threads = 1;
  solver.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  if (!summary.IsSolutionUsable()) throw std::runtime_error(summary.message);
}

}  // namespace spba
