// Photometric depth of every pixel by itself, its cameras known.
#ifndef SPBA_CORE_PIXEL_DEPTH_H_
#define SPBA_CORE_PIXEL_DEPTH_H_

#include <Eigen/Core>
#include <deque>
#include <vector>

#include "core/free_depth.h"

namespace spba {

// What a pixel looks unlike in its sources, over its inverse depth: the cost of one FreeDepthCost per source
// under a Huber loss, in the shape that ceres::TinySolver takes. Two residuals a source: along the derivative
// of its colours, and across it; their squares sum up to the loss.
class PixelDepthCost {
 public:
  using Scalar = double;
  enum { NUM_RESIDUALS = Eigen::Dynamic, NUM_PARAMETERS = 1 };

  // Borrows `cameras` and `pixel`. `loss_width`: of a residual, per value of a colour.
  PixelDepthCost(const FreeDepthCameras& cameras, const FreeDepthPixel& pixel, double loss_width);

  int NumResiduals() const { return 2 * static_cast<int>(sources_.size()); }

  // False where a source does not see the pixel's surroundings before it; the residuals are huge then, so
  // that the solver, which looks at nothing else, takes no step there.
  bool operator()(const double* inverse_depth, double* residuals, double* jacobian) const;

  // Judges the pixel by the last evaluation with a Jacobian, which TinySolver makes at its solution.
  void Judge(FreeDepthPixel& pixel) const;

 private:
  struct Source {
    const ImageSampler* image;
    Matrix3 source_from_target;
    Vector3 target_in_source;
  };

  const Pinhole camera_;
  const FreeDepthPatch patch_;
  const double squared_width_;
  std::vector<Source> sources_;
  // Of all sources, without the loss: squares of the residuals and of their derivatives.
  mutable double squares_ = 0.0, information_ = 0.0;
};

// Minimises the cost of each of `pixels`, the cameras held, and judges them; a pixel that cannot be evaluated
// where it starts is left there and judged worthless. Throws std::exception where there is no such camera.
void AdjustPixelDepths(const std::vector<double>& twists, std::vector<FreeDepthPixel>& pixels,
                       const std::deque<ImageSampler>& images, const FreeDepthOptions& options);

}  // namespace spba

#endif  // SPBA_CORE_PIXEL_DEPTH_H_
