// How each camera sees the shape at one point of evaluation.
#ifndef SPBA_CORE_VIEWS_H_
#define SPBA_CORE_VIEWS_H_

#include <vector>

#include "core/shape.h"
#include "core/variables.h"

namespace spba {

// The affine map from the object to a camera. With a focal factor f the camera's x and y are multiplied by f,
// which is what multiplying the focal lengths does to every projection.
struct FrameView {
  Matrix3 linear;
  Vector3 translation;
};

// X, dX/ds and all cameras. Borrows the shape's memory.
class Views {
 public:
  // Borrows the prior's axis styles too. Throws where the prior fails. `weak_perspective`: every point
  // projects as if it had the depth of the object's origin (Zhu et al.).
  Views(const Variables& variables, const Prior& prior, bool weak_perspective, bool with_jacobian,
        ShapeMemory* memory);

  // Whether all points lie in front of all cameras.
  bool InFront() const;

  int frame_count() const { return static_cast<int>(frames_.size()); }
  int point_count() const { return static_cast<int>(points_.size() / 3); }
  int style_count() const { return layout_.styles; }
  const std::vector<AxisStyles>& axis_styles() const { return axis_styles_; }
  const Layout& layout() const { return layout_; }
  const Variables& variables() const { return variables_; }
  const FrameView& frame(int l) const { return frames_[static_cast<size_t>(l)]; }

  Eigen::Map<const Vector3> Point(int j) const {
    return Eigen::Map<const Vector3>(&points_[3 * static_cast<size_t>(j)]);
  }
  // dx_j/ds, 3 x S row-major.
  const double* PointJacobian(int j) const {
    return jacobian_ + size_t{3} * static_cast<size_t>(j) * static_cast<size_t>(layout_.styles);
  }
  double focal() const { return focal_; }
  bool weak_perspective() const { return weak_perspective_; }
  // Point j turned as camera l sees it, about the object's origin: R x.
  Vector3 Turned(int l, int j) const {
    return variables_.camera_from_object[static_cast<size_t>(l)].rotation * Point(j);
  }
  // Point j in camera l.
  Vector3 InCamera(int l, int j) const { return frame(l).linear * Point(j) + frame(l).translation; }
  // Its derivative by the twist of camera l.
  Matrix36 ByPose(int l, int j) const;
  // Its derivative by log focal.
  static Vector3 ByLogFocal(const Vector3& in_camera) { return {in_camera.x(), in_camera.y(), 0.0}; }

 private:
  const Variables& variables_;
  Layout layout_;
  double focal_;
  const std::vector<AxisStyles>& axis_styles_;
  const std::vector<double>& points_;
  const double* jacobian_ = nullptr;
  bool weak_perspective_;
  std::vector<FrameView> frames_;
};

}  // namespace spba

#endif  // SPBA_CORE_VIEWS_H_
