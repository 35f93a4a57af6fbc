// Adds to a host's problem all that libspba's correspondences name, each residual with the loss, the weight
// and the soft tail that the solver gives it. Pick from it what suits another problem.
//
//   spba::Correspondences correspondences(sequence, prior, options, estimate);
//   const LinearShape shape = LinearShape::Of(prior, correspondences.weights().point_count);
//   AddObjectResiduals(correspondences, shape, frames, blocks, &problem);
//   AddStylePrior(correspondences.weights(), shape, blocks.style, &problem);
//
// Lifetimes: the problem borrows the shape, the images, the parameter blocks, and the correspondences, whose
// silhouettes' matches the residuals read in every evaluation. An EvaluationCallback that calls
// Correspondences::Rematch keeps these at the current values. After Correspondences::Update the points that
// are compared are others: make a new problem.
#ifndef SPBA_FUNCTORS_ADD_RESIDUALS_H_
#define SPBA_FUNCTORS_ADD_RESIDUALS_H_

#include <ceres/loss_function.h>
#include <ceres/normal_prior.h>
#include <ceres/problem.h>
#include <ceres/rotation.h>

#include <array>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "spba/functors/object_cost.h"
#include "spba/functors/soft_tail.h"

namespace spba {
inline namespace v0 {
namespace functors {

// What a frame shows; borrows the image (RGB, 0 to 255).
struct ShownFrame {
  Pinhole camera;
  const ImageSampler* image;
};

// The host's parameter blocks.
template <typename Layout>
struct ObjectBlocks {
  using Pose = std::array<double*, static_cast<std::size_t>(Layout::kBlocks)>;
  std::vector<Pose> camera_from_world;  // one a frame
  Pose world_from_object;               // with log_scale the similarity of object_cost.h
  double* log_scale;
  double* style;
};

namespace internal {

// One loss for each weight; the problem owns them.
template <typename MakeLoss>
class Losses {
 public:
  explicit Losses(MakeLoss make) : make_(std::move(make)) {}
  ceres::LossFunction* Scaled(double weight) {
    ceres::LossFunction*& loss = losses_[weight];
    if (loss == nullptr) loss = new ceres::ScaledLoss(make_(), weight, ceres::TAKE_OWNERSHIP);
    return loss;
  }

 private:
  MakeLoss make_;
  std::map<double, ceres::LossFunction*> losses_;
};

template <typename MakeLoss>
Losses<MakeLoss> LossesOf(MakeLoss make) {
  return Losses<MakeLoss>(std::move(make));
}

template <typename Layout>
std::vector<double*> Parameters(const ObjectBlocks<Layout>& blocks,
                                std::initializer_list<std::size_t> frames) {
  std::vector<double*> parameters;
  const auto add = [&](const auto& pose) { parameters.insert(parameters.end(), pose.begin(), pose.end()); };
  for (const std::size_t frame : frames) add(blocks.camera_from_world[frame]);
  add(blocks.world_from_object);
  parameters.push_back(blocks.log_scale);
  parameters.push_back(blocks.style);
  return parameters;
}

template <typename Layout, typename Residual>
std::unique_ptr<ceres::CostFunction> SoftCost(const LinearShape& shape, const std::uint32_t* where,
                                              std::uint32_t point,
                                              const std::array<Pinhole, Residual::kViews>& cameras,
                                              const Residual& residual, double width) {
  using Cost = ObjectCost<Residual, Layout>;
  auto cost = where == nullptr ? std::make_unique<Cost>(shape, point, cameras, residual)
                               : std::make_unique<Cost>(shape, where, cameras, residual);
  if (!(width > 0.0)) return cost;
  return std::make_unique<SoftTail<Residual::kResiduals>>(std::move(cost), width);
}

}  // namespace internal

// Eq. 4, 5 and 6 of all frames, which the correspondences count as the sequence does. Poses are blocks of the
// host's world; intrinsics are fixed.
template <typename Layout>
void AddObjectResiduals(const Correspondences& correspondences, const LinearShape& shape,
                        const std::vector<ShownFrame>& frames, const ObjectBlocks<Layout>& blocks,
                        ceres::Problem* problem) {
  const Weights weights = correspondences.weights();
  const auto huber = [](double width) {
    return [width]() -> ceres::LossFunction* {
      return new SoftTailLoss(std::make_unique<ceres::HuberLoss>(width), width);
    };
  };
  auto photometric = internal::LossesOf(huber(weights.photometric_huber));
  for (const ComparedPoint& compared : correspondences.compared()) {
    const ShownFrame& a = frames[compared.frame_a];
    const ShownFrame& b = frames[compared.frame_b];
    auto cost = internal::SoftCost<Layout, PhotometricResidual>(
        shape, nullptr, compared.point, {a.camera, b.camera}, {a.image, b.image}, weights.photometric_huber);
    problem->AddResidualBlock(cost.release(), photometric.Scaled(compared.weight),
                              internal::Parameters(blocks, {compared.frame_a, compared.frame_b}));
  }
  auto depths = internal::LossesOf(huber(weights.inverse_depth_huber));
  for (const KnownInverseDepth& known : correspondences.inverse_depths()) {
    const InverseDepthResidual residual{
        {known.pixel[0], known.pixel[1]}, known.inverse_depth, {known.slope[0], known.slope[1]}};
    auto cost = internal::SoftCost<Layout, InverseDepthResidual>(
        shape, nullptr, known.point, {frames[known.frame].camera}, residual, weights.inverse_depth_huber);
    problem->AddResidualBlock(cost.release(), depths.Scaled(weights.inverse_depth_weight * known.weight),
                              internal::Parameters(blocks, {known.frame}));
  }
  const double cauchy = weights.silhouette_cauchy;
  auto silhouettes = internal::LossesOf([cauchy]() -> ceres::LossFunction* {
    if (!(cauchy > 0.0)) return nullptr;
    return new SoftTailLoss(std::make_unique<ceres::CauchyLoss>(cauchy), cauchy);
  });
  for (std::size_t l = 0; l < frames.size(); ++l) {
    const SilhouetteMatches matches = correspondences.silhouette(l);
    const auto add = [&](const std::uint32_t* where, std::uint32_t point, const double* pixel,
                         double weight) {
      auto cost = internal::SoftCost<Layout, SilhouetteResidual>(
          shape, where, point, {frames[l].camera}, {pixel, weights.silhouette_tolerance}, cauchy);
      problem->AddResidualBlock(cost.release(), silhouettes.Scaled(weight),
                                internal::Parameters(blocks, {l}));
    };
    for (std::uint32_t j = 0; j < matches.point_count; ++j) {
      add(nullptr, j, matches.pixel_of_point + 2 * j, matches.point_weights[j]);
    }
    for (std::uint32_t k = 0; k < matches.pixel_count; ++k) {
      add(matches.point_of_pixel + k, 0, matches.pixels + 2 * k, matches.pixel_weight);
    }
  }
}

// -log p(s): style_weight / 2 |s|^2.
inline void AddStylePrior(const Weights& weights, const LinearShape& shape, double* style,
                          ceres::Problem* problem) {
  const int styles = shape.style_count();
  problem->AddResidualBlock(
      new ceres::NormalPrior(ceres::Matrix::Identity(styles, styles), ceres::Vector::Zero(styles)),
      new ceres::ScaledLoss(nullptr, weights.style_weight, ceres::TAKE_OWNERSHIP), style);
}

// Where the host's blocks stand, for Correspondences.
template <typename Layout>
Estimate EstimateOf(const ObjectBlocks<Layout>& blocks, int style_count) {
  Estimate estimate;
  estimate.alpha = std::exp(-*blocks.log_scale);
  estimate.style.assign(blocks.style, blocks.style + style_count);
  for (const auto& pose : blocks.camera_from_world) {
    // The images of the origin and of the axes tell a rigid transform.
    const auto in_camera = [&](const std::array<double, 3>& in_object) {
      std::array<double, 3> in_world, placed;
      const double scale = std::exp(*blocks.log_scale);
      const std::array<double, 3> scaled{scale * in_object[0], scale * in_object[1], scale * in_object[2]};
      Layout::template Apply<double>(blocks.world_from_object.data(), scaled.data(), in_world.data());
      Layout::template Apply<double>(pose.data(), in_world.data(), placed.data());
      for (double& x : placed) x /= scale;
      return placed;
    };
    Rigid3 cam_from_object;
    cam_from_object.translation = in_camera({0, 0, 0});
    double rotation[9];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      std::array<double, 3> unit{0, 0, 0};
      unit[axis] = 1.0;
      const std::array<double, 3> image = in_camera(unit);
      for (std::size_t i = 0; i < 3; ++i) rotation[3 * i + axis] = image[i] - cam_from_object.translation[i];
    }
    ceres::RotationMatrixToQuaternion(ceres::RowMajorAdapter3x3(static_cast<const double*>(rotation)),
                                      cam_from_object.quaternion_wxyz.data());
    estimate.cam_from_object.push_back(cam_from_object);
  }
  return estimate;
}

}  // namespace functors
}  // namespace v0
}  // namespace spba

#endif  // SPBA_FUNCTORS_ADD_RESIDUALS_H_
