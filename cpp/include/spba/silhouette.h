// One correspondence of the silhouettes' Chamfer distance (Eq. 5): a projected point against a pixel.
#ifndef SPBA_SILHOUETTE_H_
#define SPBA_SILHOUETTE_H_

#include <ceres/autodiff_cost_function.h>

#include <cmath>

#include "spba/camera.h"

namespace spba {

// residual[1] = max(0, |pi(point_in_camera) - pixel| - tolerance), in pixels. Whoever pairs points and pixels
// decides which direction of Eq. 5 this is; at a minimum over pairs the derivative of the minimum is that of
// the pair.
//
// The distance, not the difference: its square is the same, but its linearisation lets a point slide along
// the outline, as it may, where the difference would nail it to one pixel. Gauss-Newton needs far fewer steps
// so. False where the point is behind the camera.
//
// A tolerance of about a pixel makes discs of points and pixels, which they are. Inside the silhouette every
// point has a pixel and every pixel a point at some fraction of a pixel: without a tolerance these pairs,
// whose partners change with every motion, hold the shape where it is as friction would.
struct SilhouetteError {
  Pinhole camera;
  double pixel[2];
  double tolerance;

  template <typename T>
  bool operator()(const T* point_in_camera, T* residual) const {
    using std::sqrt;
    T projected[2];
    if (!Project(camera, point_in_camera, projected)) return false;
    const T x = projected[0] - pixel[0];
    const T y = projected[1] - pixel[1];
    const T squared = x * x + y * y;
    // At the pixel itself the distance has no derivative, its square has a zero one.
    const double near = tolerance + 1e-9;
    residual[0] = squared < T(near * near) ? T(0.0) : sqrt(squared) - tolerance;
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
    return new ceres::AutoDiffCostFunction<SilhouetteCost, 1, 6, 6, 3>(new SilhouetteCost{error});
  }
};

}  // namespace spba

#endif  // SPBA_SILHOUETTE_H_
