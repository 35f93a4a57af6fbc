// What the tests of the whole objective share: a small synthetic scene, and how they tell what they found.
#ifndef SPBA_TESTS_SCENE_H_
#define SPBA_TESTS_SCENE_H_

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "core/objective.h"
#include "core/terms/focal.h"
#include "core/terms/inverse_depth.h"
#include "core/terms/motion.h"
#include "core/terms/photometric.h"
#include "core/terms/silhouette.h"
#include "core/terms/style.h"

namespace spba {
namespace test {

constexpr double kPi = 3.14159265358979323846;
constexpr int kWidth = 48, kHeight = 40, kFrames = 4, kPoints = 180, kStyles = 5;

inline int failures = 0;

inline void Check(const std::string& name, bool holds, const std::string& found) {
  if (!holds) ++failures;
  std::printf("%s %s: %s\n", holds ? "ok  " : "FAIL", name.c_str(), found.c_str());
}

// Tells how many checks failed; what main returns.
inline int Failures() {
  std::printf("%d failures\n", failures);
  return std::min(failures, 255);
}

// A bumpy ball of points, stretched and bent by styles; not linear in them if `bent`. Those of `along_axes`
// come last.
inline Prior Ball(bool bent, const std::vector<AxisStyles>& along_axes = {}) {
  std::vector<int> axis_of;  // by style; -1 = all
  for (const AxisStyles& styles : along_axes) axis_of.insert(axis_of.end(), styles.count, styles.axis);
  axis_of.insert(axis_of.begin(), kStyles - axis_of.size(), -1);
  const auto point = [bent, axis_of](int j, const std::vector<double>& s, double* x, double* by_style) {
    const double y = 1.0 - 2.0 * (j + 0.5) / kPoints, r = std::sqrt(1.0 - y * y), a = 2.399963 * j;
    const double mean[3] = {0.3 * r * std::cos(a), 0.3 * y, 0.3 * r * std::sin(a)};
    for (int i = 0; i < 3; ++i) {
      x[i] = mean[i];
      for (int k = 0; k < kStyles; ++k) {
        const int axis = axis_of[static_cast<size_t>(k)];
        const double mode =
            axis >= 0 && axis != i ? 0.0 : 0.02 * std::sin(3.0 * k + 5.0 * mean[(i + k) % 3] + i);
        x[i] += mode * (bent ? std::sin(s[static_cast<size_t>(k)]) : s[static_cast<size_t>(k)]);
        by_style[i * kStyles + k] = mode * (bent ? std::cos(s[static_cast<size_t>(k)]) : 1.0);
      }
    }
  };
  Prior prior;
  prior.point_count = kPoints;
  prior.style_count = kStyles;
  prior.axis_styles = along_axes;
  prior.jacobian = [point](const std::vector<double>& s, std::vector<double>* jacobian) {
    double ignored[3];
    for (int j = 0; j < kPoints; ++j)
      point(j, s, ignored, &(*jacobian)[3 * kStyles * static_cast<size_t>(j)]);
  };
  const auto constant = std::make_shared<std::vector<double>>();
  if (!bent) {
    constant->resize(3 * kPoints * kStyles);
    prior.jacobian(std::vector<double>(kStyles), constant.get());
    prior.constant_jacobian = constant->data();
  }
  prior.points = [point, constant](const std::vector<double>& s, std::vector<double>* points) {
    double ignored[3 * kStyles];
    for (int j = 0; j < kPoints; ++j) point(j, s, &(*points)[3 * static_cast<size_t>(j)], ignored);
  };
  return prior;
}

// Smooth images and round masks.
struct Scene {
  std::vector<std::vector<float>> images;
  std::shared_ptr<Footage> footage = std::make_shared<Footage>();
  SilhouetteOptions silhouettes;
  Visibility visibility;

  Scene() {
    const Pinhole camera{60.0, 61.0, 23.5, 20.5};
    for (int l = 0; l < kFrames; ++l) {
      images.emplace_back();
      for (int row = 0; row < kHeight; ++row) {
        for (int column = 0; column < kWidth; ++column) {
          for (int c = 0; c < 3; ++c) {
            images.back().push_back(
                static_cast<float>(120 + 90 * std::sin(0.19 * column + 0.13 * row * (c + 1) + 0.2 * l)));
          }
        }
      }
    }
    for (int l = 0; l < kFrames; ++l) {
      FrameFootage& frame = footage->frames.emplace_back();
      frame.camera = camera;
      frame.levels.push_back(
          std::make_unique<LevelImage>(camera, images[static_cast<size_t>(l)].data(), kWidth, kHeight));
      AddMask(l, &frame);
    }
    // Neighbours and the ends, each point in some of them.
    visibility.pairs = {{0, 1, 1.0}, {1, 2, 1.0}, {3, 2, 0.7}, {0, 3, 0.4}};
    std::vector<Comparison> comparisons;
    std::vector<int> of;
    for (int j = 0; j < kPoints; ++j) {
      for (uint32_t pair = 0; pair < visibility.pairs.size(); ++pair) {
        if ((j + static_cast<int>(pair)) % 3 == 0) continue;
        comparisons.push_back({pair, static_cast<uint8_t>(1 + j % 2)});
        of.push_back(j);
      }
    }
    visibility.comparisons = PointLists<Comparison>(
        kPoints, comparisons.size(), [&](size_t i) { return of[i]; },
        [&](size_t i) { return comparisons[i]; });
    for (int j = 0; j < kPoints / 2; ++j) visibility.silhouette_weights.push_back(1.0 + 0.25 * (j % 4));
    std::vector<SeenDepth> depths;
    of.clear();
    for (int j = 0; j < kPoints; j += 2) {
      for (uint32_t l = 0; l < kFrames; ++l) {
        depths.push_back(
            {l, {camera, {20.5 + j % 9, 18.5}, 0.5 + 0.002 * (j % 17), {0.001, -0.002}}, 1.0 / (1 + j % 3)});
        of.push_back(j);
      }
    }
    visibility.depths = PointLists<SeenDepth>(
        kPoints, depths.size(), [&](size_t i) { return of[i]; }, [&](size_t i) { return depths[i]; });
  }

  void AddMask(int l, FrameFootage* frame) {
    constexpr int kPadding = 6, kGridWidth = kWidth + 2 * kPadding, kGridHeight = kHeight + 2 * kPadding;
    std::vector<uint32_t> inside, nearest;
    for (int row = 0; row < kHeight; ++row) {
      for (int column = 0; column < kWidth; ++column) {
        if (std::hypot(column - 23.0 - l, row - 20.0) < 10.0) {
          inside.push_back(static_cast<uint32_t>(row * kWidth + column));
        }
      }
    }
    for (int row = 0; row < kGridHeight; ++row) {
      for (int column = 0; column < kGridWidth; ++column) {
        uint32_t best = 0;
        int least = std::numeric_limits<int>::max();
        for (const uint32_t i : inside) {
          const int x = static_cast<int>(i % kWidth) + kPadding - column;
          const int y = static_cast<int>(i / kWidth) + kPadding - row;
          if (x * x + y * y < least) {
            least = x * x + y * y;
            best = i;
          }
        }
        nearest.push_back(best);
      }
    }
    frame->silhouette = std::make_unique<SilhouetteLookup>(kWidth, kPadding, kGridWidth, kGridHeight,
                                                           std::move(nearest), inside);
    SilhouetteShare& share = silhouettes.frames.emplace_back();
    for (size_t k = 0; k < inside.size(); k += 2) {
      share.pixels.emplace_back(inside[k] % kWidth + 0.5, inside[k] / kWidth + 0.5);
    }
    share.pixel_weight = 2.0;
    share.points = kPoints / 2;
    share.point_weight = 3.0;
  }
};

// Cameras around the ball, at rotations near 0 and near a half turn too.
inline Variables Start(double angle, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  Variables variables;
  const Vector3 axis = Vector3(unit(random), unit(random), unit(random)).normalized();
  const Matrix3 first = RotationFromTwist(angle * axis);
  for (int l = 0; l < kFrames; ++l) {
    Pose pose;
    pose.rotation = RotationFromTwist(Vector3(0.02 * unit(random), 0.11 * l, 0.02 * unit(random))) * first;
    pose.translation = Vector3(0.05 * unit(random), 0.05 * unit(random), 1.6 + 0.1 * unit(random));
    variables.camera_from_object.push_back(pose);
  }
  for (int k = 0; k < kStyles; ++k) variables.style.push_back(unit(random));
  variables.log_alpha = 0.2 * unit(random);
  variables.log_focal = 0.05 * unit(random);
  return variables;
}

inline MotionOptions Motions(const Variables& around) {
  MotionOptions options;
  options.weight = 300.0;
  options.cauchy_width = 0.02;
  options.frames = kFrames;
  for (const auto& [a, b] : {std::pair{0, 1}, std::pair{3, 1}, std::pair{0, 3}}) {
    KnownMotion motion{a, b, {}};
    const Pose& from = around.camera_from_object[static_cast<size_t>(a)];
    const Pose& to = around.camera_from_object[static_cast<size_t>(b)];
    const Matrix3 rotation =
        RotationFromTwist(Vector3(0.03, -0.02, 0.01)) * to.rotation * from.rotation.transpose();
    const Vector3 translation = to.translation - rotation * from.translation;
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(motion.error.rotation) = rotation;
    Eigen::Map<Vector3>{motion.error.translation} = translation;
    options.motions.push_back(motion);
  }
  return options;
}

inline SilhouetteOptions Silhouettes(const Scene& scene, double cauchy_width, double tolerance) {
  SilhouetteOptions options = scene.silhouettes;
  options.weight = 0.8;
  options.cauchy_width = cauchy_width;
  options.tolerance = tolerance;
  return options;
}

inline void AddAllTerms(const Scene& scene, const Variables& start, Objective* objective) {
  objective->Add(MakePhotometricTerm({1e-3, 20.0}));
  objective->Add(MakeSilhouetteTerm(Silhouettes(scene, 0.7, 0.5)));
  objective->Add(MakeInverseDepthTerm({1000.0, 0.003, kFrames}));
  objective->Add(MakeStyleTerm({3.0}));
  objective->Add(MakeMotionTerm(Motions(start)));
  objective->Add(MakeFocalTerm({0.03}));
}

inline bool SameBytes(const Evaluation& a, const Evaluation& b) {
  const auto same = [](const double* x, const double* y, Eigen::Index count) {
    return std::memcmp(x, y, sizeof(double) * static_cast<size_t>(count)) == 0;
  };
  return a.equations.costs == b.equations.costs && a.equations.matrix.size() == b.equations.matrix.size() &&
         same(a.equations.gradient.data(), b.equations.gradient.data(), a.equations.gradient.size()) &&
         same(a.equations.matrix.data(), b.equations.matrix.data(), a.equations.matrix.size());
}

}  // namespace test
}  // namespace spba

#endif  // SPBA_TESTS_SCENE_H_
