// Classic photometric bundle adjustment: poses and a free inverse depth per pixel.
#ifndef SPBA_CORE_FREE_DEPTH_H_
#define SPBA_CORE_FREE_DEPTH_H_

#include <ceres/sized_cost_function.h>

#include <cstdint>
#include <deque>
#include <vector>

#include "core/posed_cameras.h"
#include "spba/photometric.h"

namespace spba {

// The cameras of an adjustment and what they see. Borrows the twists and the images.
class FreeDepthCameras : public PosedCameras {
 public:
  // `twists`: camera_from_world[6] of one camera after another; `images`: what they see.
  FreeDepthCameras(const Pinhole& intrinsics, const double* twists, const std::deque<ImageSampler>& images);

  const Pinhole& intrinsics() const { return intrinsics_; }
  const ImageSampler& image(std::uint32_t camera) const { return images_[camera]; }

 private:
  const Pinhole intrinsics_;
  const std::deque<ImageSampler>& images_;
};

// A pixel and those around it, as the camera that has their depth sees them.
struct FreeDepthPatch {
  using Colours = Eigen::Matrix<double, 3 * FreeDepthCost::kPatch, 1>;

  FreeDepthPatch(const FreeDepthCameras& cameras, std::uint32_t target, double x, double y);

  std::uint32_t target;
  // The pixel in the middle.
  double x, y;
  // Less their mean.
  Colours colours;
};

// Every column less, in each channel, its mean over the patch, of which its rows are the colours. Light
// changes on what turns under fixed lamps; what it adds to a whole patch does not count.
template <typename Rows>
void SubtractPatchMean(Rows& rows) {
  constexpr int kPatch = FreeDepthCost::kPatch;
  for (int channel = 0; channel < 3; ++channel) {
    auto mean = rows.row(channel).eval();
    for (int k = 1; k < kPatch; ++k) mean += rows.row(3 * k + channel);
    mean /= double{kPatch};
    for (int k = 0; k < kPatch; ++k) rows.row(3 * k + channel) -= mean;
  }
}

// The point at depth 1 that pixel k of a patch shows, in the camera's frame.
inline Vector3 PatchRay(const Pinhole& camera, double x, double y, int k) {
  return {(x + FreeDepthCost::kSteps[k][0] - camera.cx) / camera.fx,
          (y + FreeDepthCost::kSteps[k][1] - camera.cy) / camera.fy, 1.0};
}

// FreeDepthCost for a solver that uses residuals only in sums over them, such as J^T J, J^T r and r^T r:
// those are the same, from fewer residuals. The parameter blocks are the same, too, but poses come from
// FreeDepthCameras. Autodiff goes over the points in the source camera alone, the chain rule on from there.
class FreeDepthBlock : public ceres::SizedCostFunction<8, 6, 6, 1> {
 public:
  // Borrows `cameras`.
  FreeDepthBlock(const FreeDepthCameras& cameras, const FreeDepthPatch& patch, std::uint32_t source)
      : cameras_(cameras), patch_(patch), source_(source) {}

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  const FreeDepthCameras& cameras_;
  const FreeDepthPatch patch_;
  const std::uint32_t source_;
};

// A pixel with depth, and the cameras that see the same.
struct FreeDepthPixel {
  std::uint32_t target;
  double x, y;
  double inverse_depth;
  std::vector<std::uint32_t> sources;
  // Once judged: root mean square of its residuals, per value of a colour; infinite where a source cannot be
  // evaluated.
  double error = 0.0;
  // Once judged: standard deviation of `inverse_depth` with noise of 1 in a colour's value, cameras known;
  // infinite where the residuals do not depend on it.
  double deviation = 0.0;
};

struct FreeDepthOptions {
  // Of all cameras.
  Pinhole intrinsics;
  // Huber width of a residual, per value of a colour.
  double loss_width;
  int max_iterations;
};

// Throws std::invalid_argument where there are not as many poses as images, or a pixel names a camera that is
// not there, or its own as a source.
void CheckCameras(const std::vector<double>& twists, const std::vector<FreeDepthPixel>& pixels,
                  const std::deque<ImageSampler>& images);

// Minimises what `pixels` look unlike in the cameras that see them, over their inverse depths and `twists`
// (camera_from_world[6] of one camera after another). The first camera stays where it is,
// and the second as far from it. Throws std::exception where there is no such camera, or where Ceres finds no
// usable solution.
void AdjustFreeDepth(std::vector<double>& twists, std::vector<FreeDepthPixel>& pixels,
                     const std::deque<ImageSampler>& images, const FreeDepthOptions& options);

}  // namespace spba

#endif  // SPBA_CORE_FREE_DEPTH_H_
