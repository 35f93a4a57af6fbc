// The perspective camera and the pose composition of the paper (Eq. 1-3), templated on the scalar so that
// they work inside ceres::AutoDiffCostFunction. Header-only; depends on Ceres alone.
//
// Camera frame: x right, y down, z forward. Pixels: the centre of the top-left pixel is (0.5, 0.5).
// A pose is a 6-vector p = [omega; t], x_camera = R(omega) x_object + t, omega in radians.
#ifndef SPBA_CAMERA_H_
#define SPBA_CAMERA_H_

#include <ceres/rotation.h>

#include "spba/pinhole.h"

namespace spba {

// Points nearer to the camera plane than this (object units) have no usable projection.
constexpr double kMinDepth = 1e-4;

// pixel[2] of point_in_camera[3] (Eq. 1, with the perspective division). False behind the camera.
template <typename T>
bool Project(const Pinhole& camera, const T* point_in_camera, T* pixel) {
  if (!(point_in_camera[2] > T(kMinDepth))) return false;
  const T inverse_depth = T(1.0) / point_in_camera[2];
  pixel[0] = camera.fx * point_in_camera[0] * inverse_depth + camera.cx;
  pixel[1] = camera.fy * point_in_camera[1] * inverse_depth + camera.cy;
  return true;
}

// point_in_target[3] = R(omega_0) point + t_0, with target_from_object = p0[6].
template <typename T>
void PointInTarget(const T* target_from_object, const T* point, T* point_in_target) {
  ceres::AngleAxisRotatePoint(target_from_object, point, point_in_target);
  for (int i = 0; i < 3; ++i) point_in_target[i] += target_from_object[3 + i];
}

// point_in_source[3] by Eq. 2-3: R(dw) R(w0) point + dt + t_0, with motion = dp[6]. The relative rotation
// does not act on t_0.
template <typename T>
void PointInSource(const T* target_from_object, const T* motion, const T* point, T* point_in_source) {
  T rotated[3];
  ceres::AngleAxisRotatePoint(target_from_object, point, rotated);
  ceres::AngleAxisRotatePoint(motion, rotated, point_in_source);
  for (int i = 0; i < 3; ++i) point_in_source[i] += motion[3 + i] + target_from_object[3 + i];
}

}  // namespace spba

#endif  // SPBA_CAMERA_H_
