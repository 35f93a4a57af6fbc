#include "state.h"

#include <ceres/jet.h>
#include <ceres/rotation.h>

namespace spba {
namespace {

// R(omega) and its three derivatives; autodiff, which is exact at omega = 0 too.
void RotationWithDerivatives(const double* omega, Matrix3* rotation, Matrix3 derivative[3]) {
  using Jet = ceres::Jet<double, 3>;
  const Jet jets[3] = {Jet(omega[0], 0), Jet(omega[1], 1), Jet(omega[2], 2)};
  Jet matrix[9];
  ceres::AngleAxisToRotationMatrix(jets, matrix);  // column-major
  for (int i = 0; i < 9; ++i) {
    rotation->data()[i] = matrix[i].a;
    for (int k = 0; k < 3; ++k) derivative[k].data()[i] = matrix[i].v[k];
  }
}

}  // namespace

void State::PrepareForEvaluation(bool evaluate_jacobians, bool) {
  ++(evaluate_jacobians ? counts_.jacobian : counts_.residual);
  Update(evaluate_jacobians);
}

bool State::Update(bool with_jacobian) {
  const bool same_point = is_current_ && current_.target_from_object == variables.target_from_object &&
                          current_.motion == variables.motion && current_.style == variables.style;
  if (same_point && (jacobian_is_current_ || !with_jacobian)) return failure_.empty();
  const bool same_style = is_current_ && current_.style == variables.style;
  try {
    if (!same_style) {
      jacobian_is_current_ = false;
      prior_.points(variables.style, &points_);
    }
    if (with_jacobian && !jacobian_is_current_) {
      prior_.jacobian(variables.style, &jacobian_);
      jacobian_is_current_ = true;
    }
  } catch (const std::exception& error) {
    // Ceres must not see an exception; the blocks report an invalid evaluation instead.
    failure_ = error.what();
    is_current_ = false;
    return false;
  }
  if (!same_point) {
    frames.resize(inputs.size());
    for (size_t l = 0; l < inputs.size(); ++l) UpdateFrame(static_cast<int>(l));
    current_ = variables;
    is_current_ = true;
  }
  return true;
}

void State::UpdateFrame(int l) {
  const FrameInput& input = inputs[l];
  FrameState& frame = frames[l];
  Matrix3 target, d_target[3];
  RotationWithDerivatives(variables.target_from_object.data(), &target, d_target);
  if (l == 0) {
    frame.rotation = target;
    frame.translation = variables.target_from_object.tail<3>();
    for (int k = 0; k < 3; ++k) frame.d_target[k] = d_target[k];
  } else {
    const Vector6& motion = variables.motion[l - 1];
    Matrix3 relative, d_relative[3];
    RotationWithDerivatives(motion.data(), &relative, d_relative);
    frame.rotation = relative * target;
    frame.translation = motion.tail<3>() + variables.target_from_object.tail<3>();
    for (int k = 0; k < 3; ++k) {
      frame.d_target[k] = relative * d_target[k];
      frame.d_motion[k] = d_relative[k] * target;
    }
  }

  if (weak_perspective) {
    for (Matrix3* matrix : {&frame.rotation, &frame.d_target[0], &frame.d_target[1], &frame.d_target[2],
                            &frame.d_motion[0], &frame.d_motion[1], &frame.d_motion[2]}) {
      matrix->row(2).setZero();
    }
  }

  const int n = point_count();
  frame.points.resize(n);
  frame.pixels.resize(n);
  frame.in_front = true;
  for (int j = 0; j < n; ++j) {
    frame.points[j] = frame.rotation * point(j) + frame.translation;
    frame.in_front &= Project(input.camera, frame.points[j].data(), frame.pixels[j].data());
  }
  if (!frame.in_front) return;

  if (input.silhouette) {
    frame.nearest_pixel.resize(input.silhouette_points);
    for (int j = 0; j < input.silhouette_points; ++j) {
      frame.nearest_pixel[j] = input.silhouette->Nearest(frame.pixels[j]);
    }
  }
  if (!input.silhouette_pixels.empty()) {
    const PointGrid grid(frame.pixels);
    frame.nearest_point.resize(input.silhouette_pixels.size());
    for (size_t k = 0; k < input.silhouette_pixels.size(); ++k) {
      frame.nearest_point[k] = grid.Nearest(input.silhouette_pixels[k]);
    }
  }
}

}  // namespace spba
