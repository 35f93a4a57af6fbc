// The cameras of a bundle adjustment.
#ifndef SPBA_CORE_POSED_CAMERAS_H_
#define SPBA_CORE_POSED_CAMERAS_H_

#include <ceres/evaluation_callback.h>

#include <cstddef>
#include <vector>

#include "core/geometry.h"

namespace spba {

// What of a pose does not depend on what is seen is computed once an evaluation. Borrows the twists.
class PosedCameras : public ceres::EvaluationCallback {
 public:
  struct PosedCamera {
    Pose camera_from_world;
    // Of the rotation.
    Matrix3 left_jacobian;
  };

  // `twists`: camera_from_world[6] of one camera after another.
  PosedCameras(const double* twists, std::size_t count);

  void PrepareForEvaluation(bool, bool new_point) override {
    if (new_point) Update();
  }
  // Brings the poses up to date with the twists.
  void Update();

  const PosedCamera& posed(std::size_t camera) const { return posed_[camera]; }

 private:
  const double* const twists_;
  std::vector<PosedCamera> posed_;
};

}  // namespace spba

#endif  // SPBA_CORE_POSED_CAMERAS_H_
