// Rigid transforms and their tangent space.
#ifndef SPBA_CORE_GEOMETRY_H_
#define SPBA_CORE_GEOMETRY_H_

#include <Eigen/Core>

namespace spba {

using Matrix3 = Eigen::Matrix3d;
using Vector2 = Eigen::Vector2d;
using Vector3 = Eigen::Vector3d;
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix36 = Eigen::Matrix<double, 3, 6, Eigen::RowMajor>;
using RowMajorMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// x_b = rotation x_a + translation.
struct Pose {
  Matrix3 rotation = Matrix3::Identity();
  Vector3 translation = Vector3::Zero();
};

// [v]x, so that [v]x u = v x u.
Matrix3 CrossProduct(const Vector3& v);

// exp([omega]x), omega in radians.
Matrix3 RotationFromTwist(const Vector3& omega);

// J with exp(omega + d) = exp(J d) exp(omega) to first order.
Matrix3 LeftJacobian(const Vector3& omega);

// The pose after a twist [omega; t] in the frame that it leads to: exp(omega) rotation, translation + t. The
// rotation does not act on the translation, as in Eq. 2-3.
Pose Twisted(const Pose& pose, const double* twist);

}  // namespace spba

#endif  // SPBA_CORE_GEOMETRY_H_
