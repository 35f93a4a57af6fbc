// Reprojection errors as bundle adjustment evaluates them.
#ifndef SPBA_CORE_REPROJECTION_BLOCK_H_
#define SPBA_CORE_REPROJECTION_BLOCK_H_

#include <ceres/sized_cost_function.h>

#include <cstddef>

#include "core/posed_cameras.h"
#include "spba/camera.h"

namespace spba {

// What Reprojection (spba/reprojection.h) is, several times as fast: a rotation and its derivative are
// PosedCameras', the chain rule on from there is in closed form.
class ReprojectionBlock : public ceres::SizedCostFunction<2, 6, 3, 1> {
 public:
  // `camera` of `cameras` sees a point at `pixel`.
  ReprojectionBlock(const PosedCameras& cameras, std::size_t camera, const Pinhole& intrinsics,
                    const Vector2& pixel)
      : cameras_(cameras), camera_(camera), intrinsics_(intrinsics), pixel_(pixel) {}

  // Of camera_from_world[6], which must be what `cameras` has, point[3] and zoom[1].
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  const PosedCameras& cameras_;
  const std::size_t camera_;
  const Pinhole intrinsics_;
  const Vector2 pixel_;
};

}  // namespace spba

#endif  // SPBA_CORE_REPROJECTION_BLOCK_H_
