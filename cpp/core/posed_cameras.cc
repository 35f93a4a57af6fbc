#include "core/posed_cameras.h"

namespace spba {

PosedCameras::PosedCameras(const double* twists, std::size_t count) : twists_(twists), posed_(count) {
  Update();
}

void PosedCameras::Update() {
  for (std::size_t camera = 0; camera < posed_.size(); ++camera) {
    const double* const twist = twists_ + 6 * camera;
    posed_[camera] = {Twisted(Pose(), twist), LeftJacobian(Vector3(twist[0], twist[1], twist[2]))};
  }
}

}  // namespace spba
