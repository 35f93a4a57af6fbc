// Trust in the off-the-shelf motion: Eq. 13, which only starts the paper's solver, as a term.
#ifndef SPBA_MOTION_H_
#define SPBA_MOTION_H_

#include <ceres/autodiff_cost_function.h>

#include <cmath>

#include "spba/camera.h"

namespace spba {

// How far b sees a point from where a, the off-the-shelf motion between the two and alpha put it:
// residual[3] = in_b - (rotation in_a + alpha translation), in object diagonals.
struct MotionError {
  // b_from_a of the off-the-shelf reconstruction, in its units; the rotation row-major.
  double rotation[9];
  double translation[3];

  template <typename T>
  bool operator()(const T* in_a, const T* in_b, const T* alpha, T* residual) const {
    for (int row = 0; row < 3; ++row) {
      T expected = alpha[0] * translation[row];
      for (int column = 0; column < 3; ++column) expected += rotation[3 * row + column] * in_a[column];
      residual[row] = in_b[row] - expected;
    }
    return true;
  }
};

// Points of the object that fix a pose: as many as there are, at the ends of the object's axes.
constexpr int kMotionPoints = 6;
// Half a car is 0.2 by 0.15 by 0.45 diagonals.
constexpr double kMotionReach = 0.25;

// point[3], k = 0 .. kMotionPoints - 1.
inline void MotionPoint(int k, double* point) {
  for (int i = 0; i < 3; ++i) point[i] = 0.0;
  point[k / 2] = k % 2 == 0 ? kMotionReach : -kMotionReach;
}

// The same for these points: residual[3 kMotionPoints], whose norm is the root mean square over the points,
// of parameter blocks p0[6], dp_l[6] and log alpha[1].
struct MotionCost {
  MotionError error;

  template <typename T>
  bool operator()(const T* target_from_object, const T* motion, const T* log_alpha, T* residual) const {
    using std::exp;
    const T alpha = exp(log_alpha[0]);
    for (int k = 0; k < kMotionPoints; ++k) {
      double fixed[3];
      MotionPoint(k, fixed);
      const T point[3] = {T(fixed[0]), T(fixed[1]), T(fixed[2])};
      T in_target[3], in_source[3];
      PointInTarget(target_from_object, point, in_target);
      PointInSource(target_from_object, motion, point, in_source);
      if (!error(in_target, in_source, &alpha, residual + 3 * k)) return false;
      for (int i = 0; i < 3; ++i) residual[3 * k + i] /= std::sqrt(double{kMotionPoints});
    }
    return true;
  }

  static ceres::CostFunction* Create(const MotionError& error) {
    return new ceres::AutoDiffCostFunction<MotionCost, 3 * kMotionPoints, 6, 6, 1>(new MotionCost{error});
  }
};

}  // namespace spba

#endif  // SPBA_MOTION_H_
