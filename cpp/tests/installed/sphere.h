// A scene small enough to be solved in a second: frames of a textured ball before a prior of balls.
#ifndef SPBA_TESTS_SPHERE_H_
#define SPBA_TESTS_SPHERE_H_

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "spba/spba.hpp"

namespace sphere {

constexpr std::uint32_t kWidth = 96, kHeight = 72;
constexpr std::uint32_t kPoints = 600;

// Its box has a diagonal of 1; the one style stretches it along z.
inline spba::Prior MakePrior() {
  const double radius = 0.5 / std::sqrt(3.0);
  std::vector<double> mean, basis, normals;
  for (std::uint32_t i = 0; i < kPoints; ++i) {
    // A bit-reversed index puts an even sample into any first part.
    std::uint32_t reversed = 0;
    for (std::uint32_t b = 0; b < 10; ++b) reversed |= ((i >> b) & 1u) << (9 - b);
    const double height = 1.0 - 2.0 * (reversed + 0.5) / 1024.0, around = 2.399963229728653 * i;
    const double flat = std::sqrt(1.0 - height * height);
    for (const double x : {flat * std::cos(around), height, flat * std::sin(around)}) {
      normals.push_back(x);
      mean.push_back(radius * x);
    }
    basis.insert(basis.end(), {0.0, 0.0, 0.1 * mean.back()});
  }
  return spba::Prior::Linear(mean, basis, 1, normals);
}

// Owns what a spba::Frame borrows.
struct Pictures {
  explicit Pictures(int index) : rgb(3 * kWidth * kHeight), mask(kWidth * kHeight) {
    for (std::uint32_t y = 0; y < kHeight; ++y) {
      for (std::uint32_t x = 0; x < kWidth; ++x) {
        const double dx = x + 0.5 - 48.0 - 2.0 * index, dy = y + 0.5 - 36.0;
        const std::size_t at = std::size_t{y} * kWidth + x;
        mask[at] = dx * dx + dy * dy < 225.0 ? 255 : 0;
        for (std::size_t c = 0; c < 3; ++c) {
          const double colour =
              mask[at] != 0 ? 128.0 + 60.0 * std::sin(0.5 * dx + static_cast<double>(c)) * std::cos(0.4 * dy)
                            : 30.0;
          rgb[3 * at + c] = static_cast<std::uint8_t>(colour);
        }
      }
    }
  }

  spba::Frame View(const std::string& name) const {
    spba::Frame frame;
    frame.name = name;
    frame.image = spba::Raster::Rgb(rgb.data(), kWidth, kHeight);
    frame.mask = spba::Raster::Grey(mask.data(), kWidth, kHeight);
    frame.camera = {100.0, 100.0, 48.0, 36.0};
    return frame;
  }

  std::vector<std::uint8_t> rgb, mask;
};

inline spba::Sequence MakeSequence(int frames) {
  spba::Sequence sequence;
  for (int i = 0; i < frames; ++i) sequence.Add(Pictures(i).View("frame" + std::to_string(i)));
  return sequence;
}

inline spba::Options QuickOptions() {
  return spba::Options::FromToml("threads = 2\n[solver]\nlevels = 1\n[init.hypotheses]\ncount = 2\n");
}

}  // namespace sphere

#endif  // SPBA_TESTS_SPHERE_H_
