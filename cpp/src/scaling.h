// Scaled variables for L-BFGS, which knows nothing of curvature when it starts: a radian, a diagonal and a
// style change the objective by very different amounts.
#ifndef SPBA_SCALING_H_
#define SPBA_SCALING_H_

#include <ceres/ceres.h>

#include <vector>

namespace spba {

// While it lives, the parameter blocks that are free in `problem` move in coordinates in which each block's
// Gauss-Newton Hessian, at the point where the scaling was made, is the identity. Values and minima are the
// same. The problem's evaluation callback must be up to date with Jacobians.
class Scaling {
 public:
  explicit Scaling(ceres::Problem* problem);
  ~Scaling();
  Scaling(const Scaling&) = delete;
  Scaling& operator=(const Scaling&) = delete;

 private:
  ceres::Problem* problem_;
  std::vector<double*> blocks_;
};

}  // namespace spba

#endif  // SPBA_SCALING_H_
