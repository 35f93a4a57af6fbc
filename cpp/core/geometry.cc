#include "core/geometry.h"

#include <ceres/rotation.h>

#include <cmath>

namespace spba {

Matrix3 CrossProduct(const Vector3& v) {
  Matrix3 matrix;
  matrix << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return matrix;
}

Matrix3 RotationFromTwist(const Vector3& omega) {
  Matrix3 rotation;
  ceres::AngleAxisToRotationMatrix(omega.data(), rotation.data());  // both column-major
  return rotation;
}

Matrix3 LeftJacobian(const Vector3& omega) {
  const double squared = omega.squaredNorm();
  // (1 - cos a) / a^2 and (a - sin a) / a^3; below the threshold two terms of their series are exact.
  double first = 0.5 - squared / 24.0, second = 1.0 / 6.0 - squared / 120.0;
  if (squared > 1e-6) {
    const double angle = std::sqrt(squared);
    first = (1.0 - std::cos(angle)) / squared;
    second = (angle - std::sin(angle)) / (squared * angle);
  }
  const Matrix3 cross = CrossProduct(omega);
  return Matrix3::Identity() + first * cross + second * cross * cross;
}

Pose Twisted(const Pose& pose, const double* twist) {
  return {RotationFromTwist(Vector3(twist[0], twist[1], twist[2])) * pose.rotation,
          pose.translation + Vector3(twist[3], twist[4], twist[5])};
}

}  // namespace spba
