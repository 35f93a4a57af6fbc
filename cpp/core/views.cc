#include "core/views.h"

#include <cmath>

#include "spba/camera.h"

namespace spba {

Views::Views(const Variables& variables, const Prior& prior, bool weak_perspective, bool with_jacobian,
             ShapeMemory* memory)
    : variables_(variables),
      layout_{static_cast<int>(variables.camera_from_object.size()),
              static_cast<int>(variables.style.size())},
      focal_(std::exp(variables.log_focal)),
      axis_styles_(prior.axis_styles),
      points_(memory->Points(prior, variables.style)),
      weak_perspective_(weak_perspective) {
  if (with_jacobian) jacobian_ = memory->Jacobian(prior, variables.style);
  frames_.reserve(variables.camera_from_object.size());
  for (const Pose& pose : variables.camera_from_object) {
    FrameView view{pose.rotation, pose.translation};
    if (weak_perspective) view.linear.row(2).setZero();
    view.linear.topRows<2>() *= focal_;
    view.translation.head<2>() *= focal_;
    frames_.push_back(view);
  }
}

bool Views::InFront() const {
  for (const FrameView& frame : frames_) {
    const Eigen::RowVector3d row = frame.linear.row(2);
    for (int j = 0; j < point_count(); ++j) {
      if (!(row.dot(Point(j)) + frame.translation.z() > kMinDepth)) return false;
    }
  }
  return true;
}

Matrix36 Views::ByPose(int l, int j) const {
  Matrix36 jacobian;
  // A turn by omega moves the turned point v by omega x v.
  jacobian.leftCols<3>() = -CrossProduct(Turned(l, j));
  if (weak_perspective_) jacobian.row(2).setZero();
  jacobian.rightCols<3>().setIdentity();
  jacobian.topRows<2>() *= focal_;
  return jacobian;
}

}  // namespace spba
