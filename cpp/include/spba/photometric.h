// Photometric consistency of one point between the target frame and a source frame (Eq. 4).
#ifndef SPBA_PHOTOMETRIC_H_
#define SPBA_PHOTOMETRIC_H_

#include <ceres/autodiff_cost_function.h>

#include "spba/camera.h"
#include "spba/image.h"

namespace spba {

// residual[3] = I_0(pi(point_in_target)) - I_l(pi(point_in_source)), RGB in the images' range.
// False (an invalid evaluation) where the point is behind either camera. Borrows the images.
struct PhotometricError {
  Pinhole target_camera;
  Pinhole source_camera;
  const ImageSampler* target_image;
  const ImageSampler* source_image;

  template <typename T>
  bool operator()(const T* point_in_target, const T* point_in_source, T* residual) const {
    T target_pixel[2], source_pixel[2], target_rgb[3], source_rgb[3];
    if (!Project(target_camera, point_in_target, target_pixel)) return false;
    if (!Project(source_camera, point_in_source, source_pixel)) return false;
    target_image->Sample(target_pixel, target_rgb);
    source_image->Sample(source_pixel, source_rgb);
    for (int c = 0; c < 3; ++c) residual[c] = target_rgb[c] - source_rgb[c];
    return true;
  }
};

// The same over parameter blocks p0[6], dp_l[6] and the point x[3] in the object frame. Wrap it in a
// ceres::HuberLoss(delta_1).
struct PhotometricCost {
  PhotometricError error;

  template <typename T>
  bool operator()(const T* target_from_object, const T* motion, const T* point, T* residual) const {
    T point_in_target[3], point_in_source[3];
    PointInTarget(target_from_object, point, point_in_target);
    PointInSource(target_from_object, motion, point, point_in_source);
    return error(point_in_target, point_in_source, residual);
  }

  static ceres::CostFunction* Create(const PhotometricError& error) {
    return new ceres::AutoDiffCostFunction<PhotometricCost, 3, 6, 6, 3>(new PhotometricCost{error});
  }
};

}  // namespace spba

#endif  // SPBA_PHOTOMETRIC_H_
