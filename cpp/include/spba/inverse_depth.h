// Agreement of a point's inverse depth with the off-the-shelf one at the pixel it is seen in (Eq. 6).
#ifndef SPBA_INVERSE_DEPTH_H_
#define SPBA_INVERSE_DEPTH_H_

#include <ceres/autodiff_cost_function.h>

#include "spba/camera.h"

namespace spba {

// residual[1] = d'(u) - alpha / z at the point's projection u, with d' in the inverse units of the
// off-the-shelf reconstruction and x_camera = alpha x'_camera (Eq. 10). False where the point is behind the
// camera.
//
// Depth maps are noisy and have holes, so d' is taken to first order about the pixel in which the point was
// seen, with a slope that the caller estimates from its surroundings. A zero slope keeps the value that the
// point met there; then nothing tells the solver that a shape may slide along itself.
struct InverseDepthError {
  Pinhole camera;
  double pixel[2];
  double inverse_depth;  // d'(pixel)
  double slope[2];       // of d' along columns and rows, a pixel

  template <typename T>
  bool operator()(const T* point_in_camera, const T* alpha, T* residual) const {
    T projected[2];
    if (!Project(camera, point_in_camera, projected)) return false;
    residual[0] = inverse_depth + slope[0] * (projected[0] - pixel[0]) +
                  slope[1] * (projected[1] - pixel[1]) - alpha[0] / point_in_camera[2];
    return true;
  }
};

// The same over parameter blocks p0[6], dp_l[6], the point x[3] and alpha[1]. For the target frame hold dp at
// zero; hold alpha where Eq. 8 gives it.
// ceres::ScaledLoss(HuberLoss(delta_2), lambda_2 / L) makes its cost that of Eq. 9.
struct InverseDepthCost {
  InverseDepthError error;

  template <typename T>
  bool operator()(const T* target_from_object, const T* motion, const T* point, const T* alpha,
                  T* residual) const {
    T point_in_source[3];
    PointInSource(target_from_object, motion, point, point_in_source);
    return error(point_in_source, alpha, residual);
  }

  static ceres::CostFunction* Create(const InverseDepthError& error) {
    return new ceres::AutoDiffCostFunction<InverseDepthCost, 1, 6, 6, 3, 1>(new InverseDepthCost{error});
  }
};

}  // namespace spba

#endif  // SPBA_INVERSE_DEPTH_H_
