// The functors with the prior's chain rule: every layout, placement and kind of intrinsics gives the same
// residuals, and every Jacobian is that of differences.
#include <ceres/ceres.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "spba/functors/object_cost.h"
#include "spba/functors/soft_tail.h"

namespace {

using namespace spba::functors;  // NOLINT: a test

void Require(bool holds, const std::string& what) {
  if (holds) return;
  std::fprintf(stderr, "FAILED: %s\n", what.c_str());
  std::exit(1);
}

constexpr int kStyles = 5;
constexpr double kLogScale = 0.7, kAlpha = 0.43;

// Everything at some state: an object before two cameras.
struct Scene {
  Scene() : shape(MakeShape()), image_a(Image(0), 64, 48), image_b(Image(1), 64, 48) {}

  static LinearShape MakeShape() {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    std::vector<double> mean(3 * 4), basis(mean.size() * kStyles);
    for (double& x : mean) x = 0.25 * unit(random);
    for (double& x : basis) x = 0.03 * unit(random);
    return LinearShape(std::move(mean), std::move(basis));
  }

  static const float* Image(int which) {
    static std::vector<float> images[2];
    std::vector<float>& rgb = images[which];
    rgb.clear();
    for (int i = 0; i < 64 * 48 * 3; ++i) {
      const int c = i % 3, x = i / 3 % 64, y = i / 3 / 64;
      rgb.push_back(static_cast<float>(128.0 + 80.0 * std::sin(0.21 * x + c + which) *
                                                   std::cos(0.17 * y - 0.3 * which)));
    }
    return rgb.data();
  }

  LinearShape shape;
  spba::ImageSampler image_a, image_b;
  double pixel[2] = {30.0, 20.0};
  std::array<spba::Pinhole, 2> cameras{{{70, 72, 32, 24}, {68, 69, 31, 25}}};
  double style[kStyles] = {0.4, -1.1, 0.3, 0.8, -0.2};
};

// A pose as rotation vector and translation, to any layout's blocks.
using Twist = std::array<double, 6>;
const Twist kPoses[2] = {{0.2, -0.4, 0.1, 0.05, -0.02, 2.1}, {0.25, -0.2, 0.15, -0.1, 0.06, 2.4}};
const Twist kWorldFromObject = {-0.6, 0.3, 0.9, 4.0, -2.0, 1.5};

void ToBlocks(const Twist& twist, AngleAxisTranslation, std::vector<std::vector<double>>* blocks) {
  blocks->emplace_back(twist.begin(), twist.end());
}

std::array<double, 4> Wxyz(const Twist& twist) {
  std::array<double, 4> q;
  ceres::AngleAxisToQuaternion(twist.data(), q.data());
  return q;
}

void ToBlocks(const Twist& twist, QuaternionWxyzTranslation, std::vector<std::vector<double>>* blocks) {
  const auto q = Wxyz(twist);
  blocks->emplace_back(q.begin(), q.end());
  blocks->emplace_back(twist.begin() + 3, twist.end());
}

void ToBlocks(const Twist& twist, QuaternionXyzwTranslation, std::vector<std::vector<double>>* blocks) {
  const auto q = Wxyz(twist);
  blocks->push_back({q[1], q[2], q[3], q[0]});
  blocks->emplace_back(twist.begin() + 3, twist.end());
}

void ToBlocks(const Twist& twist, QuaternionXyzwTranslationInOne, std::vector<std::vector<double>>* blocks) {
  const auto q = Wxyz(twist);
  blocks->push_back({q[1], q[2], q[3], q[0], twist[3], twist[4], twist[5]});
}

// camera_from_world of a camera_from_object whose translation is in object diagonals, given world_from_object
// with the scale exp(kLogScale): x_camera = exp(s) (R_co x + t_co).
Twist InWorld(const Twist& camera_from_object) {
  double r_co[9], r_wo[9];
  ceres::AngleAxisToRotationMatrix(camera_from_object.data(), ceres::RowMajorAdapter3x3(r_co));
  ceres::AngleAxisToRotationMatrix(kWorldFromObject.data(), ceres::RowMajorAdapter3x3(r_wo));
  using Matrix = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  const Matrix r_cw = Eigen::Map<Matrix>(r_co) * Eigen::Map<Matrix>(r_wo).transpose();
  const Eigen::Vector3d t_cw =
      std::exp(kLogScale) *
          Eigen::Vector3d(camera_from_object[3], camera_from_object[4], camera_from_object[5]) -
      r_cw * Eigen::Map<const Eigen::Vector3d>(&kWorldFromObject[3]);
  Twist twist;
  ceres::RotationMatrixToAngleAxis(ceres::RowMajorAdapter3x3(r_cw.data()), twist.data());
  for (int i = 0; i < 3; ++i) twist[static_cast<std::size_t>(3 + i)] = t_cw[i];
  return twist;
}

struct Found {
  std::vector<double> residuals, by_style;
};

// Residuals and the derivative by the style, after the Jacobians of all blocks were held against differences.
Found CheckedAgainstDifferences(const ceres::CostFunction& cost, std::vector<std::vector<double>> blocks,
                                std::size_t style_block, const std::string& what) {
  const auto& sizes = cost.parameter_block_sizes();
  Require(sizes.size() == blocks.size(), what + ": the number of blocks");
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    Require(sizes[i] == static_cast<int>(blocks[i].size()), what + ": a block's size");
  }
  const int rows = cost.num_residuals();
  const auto count = static_cast<std::size_t>(rows);
  std::vector<double*> parameters, jacobians;
  std::vector<std::vector<double>> storage;
  for (auto& block : blocks) parameters.push_back(block.data());
  for (auto& block : blocks) storage.emplace_back(count * block.size());
  for (auto& values : storage) jacobians.push_back(values.data());
  Found found;
  found.residuals.resize(count);
  Require(cost.Evaluate(parameters.data(), found.residuals.data(), jacobians.data()), what + ": evaluated");
  std::vector<double> plain(count);
  Require(cost.Evaluate(parameters.data(), plain.data(), nullptr), what + ": evaluated without Jacobians");
  for (std::size_t r = 0; r < count; ++r) {
    Require(std::abs(plain[r] - found.residuals[r]) < 1e-12, what + ": the same residuals without Jacobians");
  }
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    for (std::size_t k = 0; k < blocks[i].size(); ++k) {
      const double kept = blocks[i][k], step = 1e-6 * std::max(1.0, std::abs(kept));
      std::vector<double> high(count), low(count);
      blocks[i][k] = kept + step;
      Require(cost.Evaluate(parameters.data(), high.data(), nullptr), what);
      blocks[i][k] = kept - step;
      Require(cost.Evaluate(parameters.data(), low.data(), nullptr), what);
      blocks[i][k] = kept;
      for (std::size_t r = 0; r < count; ++r) {
        const double difference = (high[r] - low[r]) / (2 * step);
        const double found_here = storage[i][r * blocks[i].size() + k];
        // Central differences of values of some hundreds err by 1e-7.
        Require(std::abs(found_here - difference) <= 2e-5 * std::max(1.0, std::abs(difference)),
                what + ": block " + std::to_string(i) + " entry " + std::to_string(k) + ": " +
                    std::to_string(found_here) + " against " + std::to_string(difference));
      }
    }
  }
  found.by_style = storage[style_block];
  // Jacobians that are not asked for.
  std::vector<double*> none(blocks.size(), nullptr);
  Require(cost.Evaluate(parameters.data(), plain.data(), none.data()), what + ": evaluated with none");
  return found;
}

template <typename Residual, typename Layout, Placement kPlacement, Intrinsics kIntrinsics>
Found Evaluate(const Scene& scene, const Residual& residual, const std::string& what) {
  constexpr int kViews = Residual::kViews;
  std::array<spba::Pinhole, kViews> cameras;
  std::vector<std::vector<double>> blocks;
  for (int view = 0; view < kViews; ++view) {
    const auto at = static_cast<std::size_t>(view);
    // One camera for both, where they share it.
    cameras[at] = scene.cameras[kIntrinsics == Intrinsics::kShared ? 0 : at];
    ToBlocks(kPlacement == Placement::kInWorld ? InWorld(kPoses[at]) : kPoses[at], Layout{}, &blocks);
  }
  if (kPlacement == Placement::kInWorld) ToBlocks(kWorldFromObject, Layout{}, &blocks);
  blocks.push_back({kPlacement == Placement::kInWorld ? kLogScale : std::log(kAlpha)});
  const std::size_t style_block = blocks.size();
  blocks.emplace_back(scene.style, scene.style + kStyles);
  const int intrinsics =
      kIntrinsics == Intrinsics::kFixed ? 0 : (kIntrinsics == Intrinsics::kShared ? 1 : kViews);
  for (int i = 0; i < intrinsics; ++i) {
    const spba::Pinhole& camera = cameras[static_cast<std::size_t>(i)];
    blocks.push_back({camera.fx, camera.fy, camera.cx, camera.cy});
    // Those in the blocks count.
    if (kIntrinsics != Intrinsics::kFixed) cameras[static_cast<std::size_t>(i)] = {1, 1, 0, 0};
  }
  const ObjectCost<Residual, Layout, kPlacement, kIntrinsics> cost(scene.shape, 2u, cameras, residual);
  return CheckedAgainstDifferences(cost, blocks, style_block, what);
}

void Close(const std::vector<double>& a, const std::vector<double>& b, const std::string& what) {
  Require(a.size() == b.size(), what);
  for (std::size_t i = 0; i < a.size(); ++i) {
    Require(std::abs(a[i] - b[i]) <= 1e-9, what + ": " + std::to_string(a[i]) + " " + std::to_string(b[i]));
  }
}

template <typename Residual, typename Layout, Placement kPlacement, Intrinsics kIntrinsics>
void SameAs(const Found& first, const Scene& scene, const Residual& residual, const std::string& what) {
  const Found other = Evaluate<Residual, Layout, kPlacement, kIntrinsics>(scene, residual, what);
  Close(first.residuals, other.residuals, what + ": residuals");
  Close(first.by_style, other.by_style, what + ": the derivative by the style");
}

// `in_world`: the same residual for the placement in the world, whose alpha is exp(-kLogScale).
template <typename Residual>
void AllForms(const Scene& scene, const Residual& residual, const std::string& what) {
  using Axis = AngleAxisTranslation;
  constexpr auto kObject = Placement::kInObject;
  const Found first = Evaluate<Residual, Axis, kObject, Intrinsics::kFixed>(scene, residual, what);
  SameAs<Residual, QuaternionWxyzTranslation, kObject, Intrinsics::kFixed>(first, scene, residual,
                                                                           what + " wxyz");
  SameAs<Residual, QuaternionXyzwTranslation, kObject, Intrinsics::kFixed>(first, scene, residual,
                                                                           what + " xyzw");
  SameAs<Residual, QuaternionXyzwTranslationInOne, kObject, Intrinsics::kFixed>(first, scene, residual,
                                                                                what + " in one");
  SameAs<Residual, Axis, kObject, Intrinsics::kEach>(first, scene, residual, what + " own intrinsics");
  Evaluate<Residual, Axis, kObject, Intrinsics::kShared>(scene, residual, what + " shared intrinsics");
}

template <typename Residual>
void AllFormsInWorld(const Scene& scene, const Residual& residual, const std::string& what) {
  using Axis = AngleAxisTranslation;
  constexpr auto kWorld = Placement::kInWorld;
  const Found first = Evaluate<Residual, Axis, kWorld, Intrinsics::kFixed>(scene, residual, what);
  SameAs<Residual, QuaternionWxyzTranslation, kWorld, Intrinsics::kFixed>(first, scene, residual,
                                                                          what + " wxyz");
  SameAs<Residual, QuaternionXyzwTranslation, kWorld, Intrinsics::kFixed>(first, scene, residual,
                                                                          what + " xyzw");
  SameAs<Residual, QuaternionXyzwTranslationInOne, kWorld, Intrinsics::kEach>(
      first, scene, residual, what + " in one, own intrinsics");
}

// Value, gradient and what Gauss-Newton sees of the loss are those that SoftTailLoss promises.
void SoftTails(const Scene& scene) {
  using Cost = ObjectCost<PhotometricResidual, AngleAxisTranslation, Placement::kInObject>;
  const PhotometricResidual residual{&scene.image_a, &scene.image_b};
  constexpr double kWidth = 3.0;
  std::vector<std::vector<double>> blocks;
  for (const Twist& pose : kPoses) ToBlocks(pose, AngleAxisTranslation{}, &blocks);
  blocks.push_back({0.0});
  blocks.emplace_back(scene.style, scene.style + kStyles);
  const auto value_and_gradient = [&](std::unique_ptr<ceres::CostFunction> cost, ceres::LossFunction* loss) {
    ceres::Problem problem;
    std::vector<double*> parameters;
    for (auto& block : blocks) parameters.push_back(block.data());
    problem.AddResidualBlock(cost.release(), loss, parameters);
    std::vector<double> numbers;
    double value = 0.0;
    problem.Evaluate({}, &value, nullptr, &numbers, nullptr);
    numbers.push_back(value);
    return numbers;
  };
  const auto plain = value_and_gradient(std::make_unique<Cost>(scene.shape, 2u, scene.cameras, residual),
                                        new ceres::HuberLoss(kWidth));
  const auto soft = value_and_gradient(
      std::make_unique<SoftTail<3>>(std::make_unique<Cost>(scene.shape, 2u, scene.cameras, residual), kWidth),
      new spba::SoftTailLoss(std::make_unique<ceres::HuberLoss>(kWidth), kWidth));
  Require(plain.back() > 2 * kWidth * kWidth, "the residual lies in the tail");
  for (std::size_t i = 0; i < plain.size(); ++i) {
    Require(std::abs(plain[i] - soft[i]) <= 1e-9 * std::max(1.0, std::abs(plain[i])), "soft tails");
  }
}

// A manifold for every quaternion, and none that fixes what is free.
template <typename Layout>
void Manifolds(int tangent_size) {
  std::vector<std::vector<double>> blocks;
  ToBlocks(kPoses[0], Layout{}, &blocks);
  std::vector<double*> pointers;
  for (auto& block : blocks) pointers.push_back(block.data());
  ceres::Problem problem;
  Layout::AddTo(&problem, pointers.data());
  int sum = 0;
  for (double* const pointer : pointers) sum += problem.ParameterBlockTangentSize(pointer);
  Require(sum == tangent_size, "a pose has six degrees of freedom");
}

}  // namespace

int main() {
  const Scene scene;
  const PhotometricResidual photometric{&scene.image_a, &scene.image_b};
  const SilhouetteResidual silhouette{scene.pixel, 0.5};
  const InverseDepthResidual inverse_depth{{31.0, 22.0}, 0.3, {0.002, -0.001}};
  AllForms(scene, photometric, "photometric");
  AllForms(scene, silhouette, "silhouette");
  AllForms(scene, inverse_depth, "inverse depth");
  AllFormsInWorld(scene, photometric, "photometric in the world");
  AllFormsInWorld(scene, silhouette, "silhouette in the world");
  AllFormsInWorld(scene, inverse_depth, "inverse depth in the world");
  // Where they do not depend on alpha, both placements are one.
  using Axis = AngleAxisTranslation;
  Close(
      (Evaluate<PhotometricResidual, Axis, Placement::kInObject, Intrinsics::kFixed>(scene, photometric, ""))
          .by_style,
      (Evaluate<PhotometricResidual, Axis, Placement::kInWorld, Intrinsics::kFixed>(scene, photometric, ""))
          .by_style,
      "placements");
  SoftTails(scene);
  Manifolds<AngleAxisTranslation>(6);
  Manifolds<QuaternionWxyzTranslation>(6);
  Manifolds<QuaternionXyzwTranslation>(6);
  Manifolds<QuaternionXyzwTranslationInOne>(6);
  std::puts("all as it should be");
  return 0;
}
