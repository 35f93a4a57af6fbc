#include "core/reprojection_block.h"

#include <Eigen/Geometry>

namespace spba {
namespace {

template <int kSize>
using BlockJacobian = Eigen::Matrix<double, 2, kSize, kSize == 1 ? Eigen::ColMajor : Eigen::RowMajor>;

}  // namespace

bool ReprojectionBlock::Evaluate(double const* const* parameters, double* residuals,
                                 double** jacobians) const {
  const PosedCameras::PosedCamera& camera = cameras_.posed(camera_);
  const Vector3 turned = camera.camera_from_world.rotation * Eigen::Map<const Vector3>(parameters[1]);
  const Vector3 in_camera = turned + camera.camera_from_world.translation;
  const double zoom = parameters[2][0];
  const Vector3 zoomed(zoom * in_camera[0], zoom * in_camera[1], in_camera[2]);
  Eigen::Map<Vector2> residual(residuals);
  if (!Project(intrinsics_, zoomed.data(), residuals)) return false;
  residual -= pixel_;
  if (jacobians == nullptr) return true;
  const double inverse_depth = 1.0 / in_camera[2];
  const Vector2 by_zoom(intrinsics_.fx * in_camera[0] * inverse_depth,
                        intrinsics_.fy * in_camera[1] * inverse_depth);
  BlockJacobian<3> by_position;
  by_position << intrinsics_.fx * zoom * inverse_depth, 0.0, -zoom * by_zoom[0] * inverse_depth,  //
      0.0, intrinsics_.fy * zoom * inverse_depth, -zoom * by_zoom[1] * inverse_depth;
  if (jacobians[0] != nullptr) {
    Eigen::Map<BlockJacobian<6>> by_pose(jacobians[0]);
    // by_position (turn x turned) = (turned x by_position) turn.
    BlockJacobian<3> by_turn;
    for (int r = 0; r < 2; ++r) by_turn.row(r) = turned.cross(by_position.row(r).transpose()).transpose();
    by_pose.leftCols<3>().noalias() = by_turn * camera.left_jacobian;
    by_pose.rightCols<3>() = by_position;
  }
  if (jacobians[1] != nullptr) {
    Eigen::Map<BlockJacobian<3>>{jacobians[1]}.noalias() = by_position * camera.camera_from_world.rotation;
  }
  if (jacobians[2] != nullptr) Eigen::Map<Vector2>{jacobians[2]} = by_zoom;
  return true;
}

}  // namespace spba
