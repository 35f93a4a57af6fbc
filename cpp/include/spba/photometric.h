// Photometric consistency of one point between the target frame and a source frame (Eq. 4).
#ifndef SPBA_PHOTOMETRIC_H_
#define SPBA_PHOTOMETRIC_H_

#include <ceres/autodiff_cost_function.h>

#include "spba/camera.h"
#include "spba/image.h"

namespace spba {

// rgb[3] = I(pi(point_in_camera)): what colour a point has in a frame. False behind the camera. Borrows the
// image.
struct PointColour {
  Pinhole camera;
  const ImageSampler* image;

  template <typename T>
  bool operator()(const T* point_in_camera, T* rgb) const {
    T pixel[2];
    if (!Project(camera, point_in_camera, pixel)) return false;
    image->Sample(pixel, rgb);
    return true;
  }
};

// residual[3] = I_0(pi(point_in_target)) - I_l(pi(point_in_source)), RGB in the images' range.
// False (an invalid evaluation) where the point is behind either camera. Borrows the images.
struct PhotometricError {
  Pinhole target_camera;
  Pinhole source_camera;
  const ImageSampler* target_image;
  const ImageSampler* source_image;

  template <typename T>
  bool operator()(const T* point_in_target, const T* point_in_source, T* residual) const {
    T target_rgb[3], source_rgb[3];
    if (!PointColour{target_camera, target_image}(point_in_target, target_rgb)) return false;
    if (!PointColour{source_camera, source_image}(point_in_source, source_rgb)) return false;
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

// The same without a prior, as classic photometric bundle adjustment has it: parameter blocks
// camera_from_world[6] of target and source, and the inverse depth[1] at which the target sees a pixel, which
// is the same for the pixels around it. residual[3 kPatch], a pixel's three after another. Wrap it in a
// robust loss.
struct FreeDepthCost {
  // The pixel, and those a step to the sides, above and below.
  static constexpr int kPatch = 5;
  static constexpr double kSteps[kPatch][2] = {{0, 0}, {-1, 0}, {1, 0}, {0, -1}, {0, 1}};

  PhotometricError error;
  // The pixel in the middle.
  double x, y;

  template <typename T>
  bool operator()(const T* target_from_world, const T* source_from_world, const T* inverse_depth,
                  T* residual) const {
    if (!(inverse_depth[0] > T(0.0))) return false;
    const Pinhole& camera = error.target_camera;
    const T world_from_target[3] = {-target_from_world[0], -target_from_world[1], -target_from_world[2]};
    for (int k = 0; k < kPatch; ++k) {
      const T depth = 1.0 / inverse_depth[0];
      const T in_target[3] = {depth * ((x + kSteps[k][0] - camera.cx) / camera.fx),
                              depth * ((y + kSteps[k][1] - camera.cy) / camera.fy), depth};
      T turned[3], in_world[3], in_source[3];
      for (int i = 0; i < 3; ++i) turned[i] = in_target[i] - target_from_world[3 + i];
      ceres::AngleAxisRotatePoint(world_from_target, turned, in_world);
      PointInTarget(source_from_world, in_world, in_source);
      if (!error(in_target, in_source, residual + 3 * k)) return false;
    }
    // Light changes on what turns under fixed lamps; what it adds to a whole patch does not count.
    for (int channel = 0; channel < 3; ++channel) {
      T mean(0.0);
      for (int k = 0; k < kPatch; ++k) mean += residual[3 * k + channel] / double{kPatch};
      for (int k = 0; k < kPatch; ++k) residual[3 * k + channel] -= mean;
    }
    return true;
  }

  static ceres::CostFunction* Create(const PhotometricError& error, double x, double y) {
    return new ceres::AutoDiffCostFunction<FreeDepthCost, 3 * kPatch, 6, 6, 1>(
        new FreeDepthCost{error, x, y});
  }
};

}  // namespace spba

#endif  // SPBA_PHOTOMETRIC_H_
