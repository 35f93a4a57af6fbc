// Scaled coordinates for L-BFGS, which knows nothing of curvature when it starts: a radian, a diagonal and a
// style change the objective by very different amounts.
#ifndef SPBA_CORE_SCALING_H_
#define SPBA_CORE_SCALING_H_

#include <ceres/manifold.h>

#include <Eigen/Core>
#include <memory>

namespace spba {

// Moves a parameter block in coordinates in which `hessian` is the identity. Values and minima are the same.
std::unique_ptr<ceres::Manifold> UnitCurvature(const Eigen::MatrixXd& hessian);

}  // namespace spba

#endif  // SPBA_CORE_SCALING_H_
