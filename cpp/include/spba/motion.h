// Trust in the off-the-shelf motion: Eq. 13, which only starts the paper's solver, as a term.
#ifndef SPBA_MOTION_H_
#define SPBA_MOTION_H_

#include <ceres/autodiff_cost_function.h>

#include <cmath>

#include "spba/camera.h"

namespace spba {

// residual[3 kPoints] in object diagonals: how far dp_l takes points of the object from where the
// off-the-shelf motion and alpha put them, in the source camera's frame. The root mean square over the points
// is the residual's norm. Parameter blocks p0[6], dp_l[6] and log alpha[1].
struct MotionError {
  // As many as fix a pose, at the ends of the object's axes.
  static constexpr int kPoints = 6;
  // Half a car is 0.2 by 0.15 by 0.45 diagonals.
  static constexpr double kReach = 0.25;

  // Of the off-the-shelf reconstruction, in its units: source_from_target, the rotation row-major.
  double rotation[9];
  double translation[3];

  template <typename T>
  bool operator()(const T* target_from_object, const T* motion, const T* log_alpha, T* residual) const {
    using std::exp;
    const T alpha = exp(log_alpha[0]);
    for (int k = 0; k < kPoints; ++k) {
      T point[3] = {T(0.0), T(0.0), T(0.0)};
      point[k / 2] = T(k % 2 == 0 ? kReach : -kReach);
      T in_target[3], in_source[3];
      PointInTarget(target_from_object, point, in_target);
      PointInSource(target_from_object, motion, point, in_source);
      for (int row = 0; row < 3; ++row) {
        T expected = alpha * translation[row];
        for (int column = 0; column < 3; ++column) expected += rotation[3 * row + column] * in_target[column];
        residual[3 * k + row] = (in_source[row] - expected) / std::sqrt(double{kPoints});
      }
    }
    return true;
  }

  static ceres::CostFunction* Create(const MotionError& error) {
    return new ceres::AutoDiffCostFunction<MotionError, 3 * kPoints, 6, 6, 1>(new MotionError(error));
  }
};

}  // namespace spba

#endif  // SPBA_MOTION_H_
