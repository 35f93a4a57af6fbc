// What the frames show: read-only, and shared by all problems over them.
#ifndef SPBA_CORE_FOOTAGE_H_
#define SPBA_CORE_FOOTAGE_H_

#include <memory>
#include <vector>

#include "core/nearest.h"
#include "spba/camera.h"
#include "spba/image.h"

namespace spba {

// An image and its camera at one pyramid level. Borrows the colours.
struct LevelImage {
  Pinhole camera;
  ImageSampler sampler;

  LevelImage(const Pinhole& pinhole, const float* rgb, int width, int height)
      : camera(pinhole), sampler(rgb, width, height) {}
};

struct FrameFootage {
  Pinhole camera;                                   // at full resolution, for silhouettes and depth
  std::vector<std::unique_ptr<LevelImage>> levels;  // finest first
  std::unique_ptr<SilhouetteLookup> silhouette;     // of the mask
};

struct Footage {
  std::vector<FrameFootage> frames;
};

}  // namespace spba

#endif  // SPBA_CORE_FOOTAGE_H_
