// One correspondence of the silhouettes' Chamfer distance (Eq. 5): a projected point against a pixel.
#ifndef SPBA_SILHOUETTE_H_
#define SPBA_SILHOUETTE_H_

#include <ceres/autodiff_cost_function.h>

#include "spba/camera.h"

namespace spba {

// residual[2] = pi(point_in_camera) - pixel, in pixels. Whoever pairs points and pixels decides which
// direction of Eq. 5 this is; at a minimum over pairs the derivative of the minimum is that of the pair.
// False where the point is behind the camera.
struct SilhouetteError {
  Pinhole camera;
  double pixel[2];

  template <typename T>
  bool operator()(const T* point_in_camera, T* residual) const {
    if (!Project(camera, point_in_camera, residual)) return false;
    residual[0] -= pixel[0];
    residual[1] -= pixel[1];
    return true;
  }
};

// The same over parameter blocks p0[6], dp_l[6] and the point x[3]. For the target frame hold dp at zero.
// ceres::ScaledLoss(nullptr, 2 lambda_1 / L) makes its cost that of Eq. 9.
struct SilhouetteCost {
  SilhouetteError error;

  template <typename T>
  bool operator()(const T* target_from_object, const T* motion, const T* point, T* residual) const {
    T point_in_source[3];
    PointInSource(target_from_object, motion, point, point_in_source);
    return error(point_in_source, residual);
  }

  static ceres::CostFunction* Create(const SilhouetteError& error) {
    return new ceres::AutoDiffCostFunction<SilhouetteCost, 2, 6, 6, 3>(new SilhouetteCost{error});
  }
};

}  // namespace spba

#endif  // SPBA_SILHOUETTE_H_
