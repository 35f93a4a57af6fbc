#include "bridge/free_depth.h"

#include <algorithm>
#include <deque>
#include <stdexcept>
#include <vector>

#include "bridge/logs.h"
#include "core/free_depth.h"
#include "spba-ceres/src/bridge/bundle.rs.h"

namespace spba {
namespace bridge {

void adjust_photometric(rust::Slice<double> cameras, rust::Vec<FreePixel>& pixels,
                        rust::Slice<const float> images, const PhotometricOptions& options) {
  RouteLogs();
  const std::size_t frames = cameras.size() / 6;
  const std::size_t size = std::size_t{3} * options.width * options.height;
  if (size == 0 || cameras.size() % 6 != 0 || images.size() != frames * size) {
    throw std::invalid_argument("six numbers and one image a camera are needed");
  }
  std::deque<ImageSampler> samplers;
  for (std::size_t frame = 0; frame < frames; ++frame) {
    samplers.emplace_back(images.data() + frame * size, static_cast<int>(options.width),
                          static_cast<int>(options.height));
  }
  std::vector<double> twists(cameras.begin(), cameras.end());
  std::vector<FreeDepthPixel> adjusted;
  adjusted.reserve(pixels.size());
  for (const FreePixel& pixel : pixels) {
    adjusted.push_back({pixel.frame, pixel.x, pixel.y, pixel.inverse_depth,
                        std::vector<std::uint32_t>(pixel.seen_in.begin(), pixel.seen_in.end())});
  }
  AdjustFreeDepth(twists, adjusted, samplers,
                  {{options.fx, options.fy, options.cx, options.cy},
                   options.loss_width,
                   options.hold_cameras,
                   static_cast<int>(options.max_iterations)});
  std::copy(twists.begin(), twists.end(), cameras.begin());
  for (std::size_t i = 0; i < adjusted.size(); ++i) {
    pixels[i].inverse_depth = adjusted[i].inverse_depth;
    pixels[i].error = adjusted[i].error;
    pixels[i].deviation = adjusted[i].deviation;
  }
}

}  // namespace bridge
}  // namespace spba
