// Reprojection error of a free point in a free camera with a free focal length: classic bundle adjustment,
// which prepares poses from features before Eq. 9 takes over.
#ifndef SPBA_REPROJECTION_H_
#define SPBA_REPROJECTION_H_

#include <ceres/autodiff_cost_function.h>

#include <cmath>

#include "spba/camera.h"

namespace spba {

// residual[2] in pixels of camera_from_world[6], point[3] (world) and zoom[1], which multiplies fx and fy.
// False behind the camera.
class Reprojection {
 public:
  Reprojection(const Pinhole& camera, double x, double y) : camera_(camera), x_(x), y_(y) {}

  static ceres::CostFunction* Create(const Pinhole& camera, double x, double y) {
    return new ceres::AutoDiffCostFunction<Reprojection, 2, 6, 3, 1>(new Reprojection(camera, x, y));
  }

  template <typename T>
  bool operator()(const T* camera_from_world, const T* point, const T* zoom, T* residual) const {
    T point_in_camera[3];
    PointInTarget(camera_from_world, point, point_in_camera);
    // A zoom is a camera that sees everything as much wider.
    point_in_camera[0] *= zoom[0];
    point_in_camera[1] *= zoom[0];
    if (!Project(camera_, point_in_camera, residual)) return false;
    residual[0] -= x_;
    residual[1] -= y_;
    return true;
  }

 private:
  Pinhole camera_;
  double x_, y_;
};

// What is known of a focal length beforehand: residual[1] = log(zoom) / deviation.
class ZoomPrior {
 public:
  explicit ZoomPrior(double deviation) : deviation_(deviation) {}

  static ceres::CostFunction* Create(double deviation) {
    return new ceres::AutoDiffCostFunction<ZoomPrior, 1, 1>(new ZoomPrior(deviation));
  }

  template <typename T>
  bool operator()(const T* zoom, T* residual) const {
    using std::log;
    if (!(zoom[0] > T(0.0))) return false;
    residual[0] = log(zoom[0]) / deviation_;
    return true;
  }

 private:
  double deviation_;
};

// The unit of length of what is seen up to its size: residual[1] = log(|x| / length) / kDeviation of a point
// of the world at x in camera_from_world[6] = [omega; t]. Nothing else depends on the size, so that it ends
// at 0. A manifold would say the same, but Ceres eliminates points faster where every camera has as many
// variables.
class DistancePrior {
 public:
  DistancePrior(const double* point, double length) : point_{point[0], point[1], point[2]}, length_(length) {}

  static ceres::CostFunction* Create(const double* point, double length) {
    return new ceres::AutoDiffCostFunction<DistancePrior, 1, 6>(new DistancePrior(point, length));
  }

  template <typename T>
  bool operator()(const T* camera_from_world, T* residual) const {
    using std::log;
    const T point[3] = {T(point_[0]), T(point_[1]), T(point_[2])};
    T x[3];
    PointInTarget(camera_from_world, point, x);
    const T square = x[0] * x[0] + x[1] * x[1] + x[2] * x[2];
    if (!(square > T(0.0))) return false;
    residual[0] = log(square / (length_ * length_)) / (2.0 * kDeviation);
    return true;
  }

 private:
  static constexpr double kDeviation = 1e-3;
  double point_[3];
  double length_;
};

}  // namespace spba

#endif  // SPBA_REPROJECTION_H_
