#include "objective.h"

#include <ceres/loss_function.h>
#include <ceres/normal_prior.h>

#include <limits>

namespace spba {
namespace {

ceres::Problem::Options ProblemOptions(State* state) {
  ceres::Problem::Options options;
  options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.evaluation_callback = state;
  // We never add a parameter block twice to one residual block; the checks cost a third of the building.
  options.disable_all_safety_checks = true;
  return options;
}

// weight * rho(s); Ceres halves it.
std::unique_ptr<ceres::LossFunction> Scaled(double weight, std::unique_ptr<ceres::LossFunction> rho) {
  return std::make_unique<ceres::ScaledLoss>(rho.release(), weight, ceres::TAKE_OWNERSHIP);
}

// A Robust loss of that width for residuals with soft tails.
template <typename Robust>
std::unique_ptr<ceres::LossFunction> Soft(double width) {
  return std::make_unique<SoftTailLoss>(std::make_unique<Robust>(width), width);
}

}  // namespace

Objective::Objective(State* state, const Weights& weights)
    : state_(state), weights_(weights), problem_(ProblemOptions(state)) {
  Variables& variables = state->variables;
  problem_.AddParameterBlock(variables.target_from_object.data(), 6);
  for (Vector6& motion : variables.motion) problem_.AddParameterBlock(motion.data(), 6);
  problem_.AddParameterBlock(variables.style.data(), state->style_count());
  problem_.AddParameterBlock(&variables.log_alpha, 1);
  if (weights.style > 0) {
    const int s = state->style_count();
    style_block_ =
        std::make_unique<ceres::NormalPrior>(ceres::Matrix::Identity(s, s), ceres::Vector::Zero(s));
    style_loss_ = Scaled(weights.style, std::make_unique<StyleLoss>(weights.style_reach));
    problem_.AddResidualBlock(style_block_.get(), style_loss_.get(), variables.style.data());
  }
}

template <typename Block>
void Objective::AddToProblem(int frame, BlockGroup<Block>& group, double* last) {
  Variables& variables = state_->variables;
  std::vector<double*> parameters{variables.target_from_object.data()};
  if (frame > 0) parameters.push_back(variables.motion[frame - 1].data());
  parameters.push_back(variables.style.data());
  if (last != nullptr) parameters.push_back(last);
  for (Block& block : group.blocks) problem_.AddResidualBlock(&block, group.loss.get(), parameters);
}

void Objective::AddPhotometric(int frame, const std::vector<uint32_t>& points,
                               const std::vector<uint8_t>& directions, const PhotometricError& error) {
  // A point seen from both sides has the same residual, up to its sign, in both of Eq. 4's sums.
  for (const uint8_t count : {1, 2}) {
    BlockGroup<PhotometricBlock>& group = photometric_.emplace_back();
    group.loss = Scaled(weights_.photometric * count, Soft<ceres::HuberLoss>(weights_.photometric_huber));
    for (size_t i = 0; i < points.size(); ++i) {
      if (directions[i] == count) {
        group.blocks.emplace_back(*state_, frame, weights_.photometric_huber, static_cast<int>(points[i]),
                                  error);
      }
    }
    AddToProblem(frame, group);
  }
}

void Objective::AddSilhouette(int frame, double pixel_weight, double point_weight) {
  // Eq. 5 squares without a half.
  const double weight = 2.0 * weights_.silhouette / state_->inputs.size();
  const bool robust = weights_.silhouette_cauchy > 0;
  const double width = robust ? weights_.silhouette_cauchy : std::numeric_limits<double>::infinity();
  const auto loss = [&](double side_weight) {
    return Scaled(weight * side_weight, robust ? Soft<ceres::CauchyLoss>(width) : nullptr);
  };
  const FrameInput& input = state_->inputs[frame];
  auto& to_silhouette = point_to_silhouette_.emplace_back();
  to_silhouette.loss = loss(point_weight);
  for (int j = 0; j < input.silhouette_points; ++j) {
    to_silhouette.blocks.emplace_back(*state_, frame, width, j);
  }
  AddToProblem(frame, to_silhouette);
  auto& to_point = silhouette_to_point_.emplace_back();
  to_point.loss = loss(pixel_weight);
  for (size_t k = 0; k < input.silhouette_pixels.size(); ++k) {
    to_point.blocks.emplace_back(*state_, frame, width, static_cast<int>(k));
  }
  AddToProblem(frame, to_point);
}

void Objective::AddInverseDepth(int frame, const std::vector<uint32_t>& points,
                                const std::vector<InverseDepthError>& errors) {
  auto& group = inverse_depth_.emplace_back();
  group.loss = Scaled(weights_.inverse_depth / state_->inputs.size(),
                      Soft<ceres::HuberLoss>(weights_.inverse_depth_huber));
  for (size_t i = 0; i < points.size(); ++i) {
    group.blocks.emplace_back(*state_, frame, weights_.inverse_depth_huber, static_cast<int>(points[i]),
                              errors[i]);
  }
  AddToProblem(frame, group, &state_->variables.log_alpha);
}

void Objective::AddMotion(int frame, const MotionError& error) {
  if (motion_loss_ == nullptr) {
    motion_loss_ = Scaled(weights_.motion / state_->inputs.size(),
                          std::make_unique<ceres::CauchyLoss>(weights_.motion_cauchy));
  }
  Variables& variables = state_->variables;
  motion_.push_back({frame, std::unique_ptr<ceres::CostFunction>(MotionError::Create(error))});
  problem_.AddResidualBlock(motion_.back().cost.get(), motion_loss_.get(),
                            variables.target_from_object.data(), variables.motion[frame - 1].data(),
                            &variables.log_alpha);
}

double Objective::MotionCost() const {
  const Variables& variables = state_->variables;
  double sum = 0.0;
  for (const MotionBlock& block : motion_) {
    const double* parameters[] = {variables.target_from_object.data(),
                                  variables.motion[block.frame - 1].data(), &variables.log_alpha};
    double residuals[3 * MotionError::kPoints], squared = 0.0, rho[3];
    block.cost->Evaluate(parameters, residuals, nullptr);
    for (const double residual : residuals) squared += residual * residual;
    motion_loss_->Evaluate(squared, rho);
    sum += 0.5 * rho[0];
  }
  return sum;
}

double Objective::StyleCost() const {
  double squared_norm = 0.0;
  for (const double s : state_->variables.style) squared_norm += s * s;
  if (style_loss_ == nullptr) return 0.0;
  double rho[3];
  style_loss_->Evaluate(squared_norm, rho);
  return 0.5 * rho[0];
}

}  // namespace spba
