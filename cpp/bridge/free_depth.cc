#include "bridge/free_depth.h"

#include <algorithm>
#include <deque>
#include <stdexcept>
#include <vector>

#include "core/free_depth.h"
#include "core/pixel_depth.h"
#include "spba-ceres/src/bridge/bundle.rs.h"

namespace spba {
namespace bridge {
namespace {

// What both adjust, as the core takes it.
struct Problem {
  std::vector<double> twists;
  std::vector<FreeDepthPixel> pixels;
  std::deque<ImageSampler> images;
  FreeDepthOptions options;

  Problem(rust::Slice<const double> cameras, const rust::Vec<FreePixel>& from,
          rust::Slice<const float> colours, const PhotometricOptions& chosen)
      : twists(cameras.begin(), cameras.end()),
        options{{chosen.fx, chosen.fy, chosen.cx, chosen.cy},
                chosen.loss_width,
                static_cast<int>(chosen.max_iterations)} {
    const std::size_t frames = cameras.size() / 6;
    const std::size_t size = std::size_t{3} * chosen.width * chosen.height;
    if (size == 0 || cameras.size() % 6 != 0 || colours.size() != frames * size) {
      throw std::invalid_argument("six numbers and one image a camera are needed");
    }
    for (std::size_t frame = 0; frame < frames; ++frame) {
      images.emplace_back(colours.data() + frame * size, static_cast<int>(chosen.width),
                          static_cast<int>(chosen.height));
    }
    pixels.reserve(from.size());
    for (const FreePixel& pixel : from) {
      pixels.push_back({pixel.frame, pixel.x, pixel.y, pixel.inverse_depth,
                        std::vector<std::uint32_t>(pixel.seen_in.begin(), pixel.seen_in.end())});
    }
  }

  void CopyTo(rust::Vec<FreePixel>& to) const {
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      to[i].inverse_depth = pixels[i].inverse_depth;
      to[i].error = pixels[i].error;
      to[i].deviation = pixels[i].deviation;
    }
  }
};

}  // namespace

void adjust_photometric(rust::Slice<double> cameras, rust::Vec<FreePixel>& pixels,
                        rust::Slice<const float> images, const PhotometricOptions& options) {
  Problem problem({cameras.data(), cameras.size()}, pixels, images, options);
  AdjustFreeDepth(problem.twists, problem.pixels, problem.images, problem.options);
  std::copy(problem.twists.begin(), problem.twists.end(), cameras.begin());
  problem.CopyTo(pixels);
}

void adjust_pixel_depths(rust::Slice<const double> cameras, rust::Vec<FreePixel>& pixels,
                         rust::Slice<const float> images, const PhotometricOptions& options) {
  Problem problem(cameras, pixels, images, options);
  AdjustPixelDepths(problem.twists, problem.pixels, problem.images, problem.options);
  problem.CopyTo(pixels);
}

}  // namespace bridge
}  // namespace spba
