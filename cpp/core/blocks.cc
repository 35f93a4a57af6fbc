#include "core/blocks.h"

#include <cmath>

namespace spba {

void BlockState::PrepareForEvaluation(bool evaluate_jacobians, bool) {
  ++(evaluate_jacobians ? counts_.jacobian : counts_.residual);
  usable_ = false;
  failure_.clear();
  variables_ = coordinates_.Current();
  try {
    visits_.clear();
    views_.emplace(variables_, objective_.prior(), objective_.weak_perspective(), evaluate_jacobians,
                   &memory_);
    if (!views_->InFront()) {
      failure_ = kBehindCamera;
      return;
    }
    for (const auto& term : objective_.terms()) {
      visits_[term.get()] = term->Begin(*views_, objective_.footage(), visibility_, 1);
    }
    by_omega_.clear();
    for (int l = 0; l < views_->frame_count(); ++l) by_omega_.push_back(coordinates_.ByOmega(l));
    usable_ = true;
  } catch (const std::exception& error) {
    // Ceres must not see an exception; the blocks report an invalid evaluation instead.
    failure_ = error.what();
  }
}

AnyBlock::AnyBlock(const BlockState& state, std::vector<int> frames, int residuals, bool with_alpha)
    : state_(state),
      frames_(std::move(frames)),
      together_(state.coordinates().free().poses == PoseMotion::kTogether),
      with_alpha_(with_alpha),
      with_focal_(state.coordinates().free().log_focal) {
  set_num_residuals(residuals);
  std::vector<int>& sizes = *mutable_parameter_block_sizes();
  sizes.assign(together_ ? 1 : frames_.size(), 6);
  sizes.push_back(state.objective().prior().style_count);
  if (with_alpha_) sizes.push_back(1);
  if (with_focal_) sizes.push_back(1);
}

std::vector<double*> AnyBlock::Parameters() const {
  Coordinates& coordinates = state_.coordinates();
  std::vector<double*> parameters;
  for (size_t i = 0; i < (together_ ? 1 : frames_.size()); ++i) {
    parameters.push_back(coordinates.PoseBlock(frames_[i]));
  }
  parameters.push_back(coordinates.StyleBlock());
  if (with_alpha_) parameters.push_back(coordinates.LogAlphaBlock());
  if (with_focal_) parameters.push_back(coordinates.LogFocalBlock());
  return parameters;
}

void AnyBlock::ToPoseBlock(int l, int rows, double* jacobian) const {
  Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 6, Eigen::RowMajor>> matrix(jacobian, rows, 6);
  matrix.leftCols<3>() = (matrix.leftCols<3>() * state_.by_omega(l)).eval();
}

namespace {

ceres::Problem::Options ProblemOptions(BlockState* state) {
  ceres::Problem::Options options;
  options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.evaluation_callback = state;
  // We never add a parameter block twice to one residual block; the checks cost a third of the building.
  options.disable_all_safety_checks = true;
  return options;
}

}  // namespace

BlockProblem::BlockProblem(const Objective& objective, const Visibility& visibility, Coordinates* coordinates,
                           Counts* counts)
    : state_(objective, visibility, coordinates, counts), problem_(ProblemOptions(&state_)) {
  for (const auto& term : objective.terms()) term->AddBlocks(visibility, this);
  std::vector<double*> used;
  problem_.GetParameterBlocks(&used);
  for (double* block : used) {
    if (!coordinates->IsFree(block)) problem_.SetParameterBlockConstant(block);
  }
}

void BlockProblem::Add(std::unique_ptr<AnyBlock> block, ceres::LossFunction* loss) {
  const std::vector<double*> parameters = block->Parameters();
  Add(std::unique_ptr<ceres::CostFunction>(std::move(block)), loss, parameters);
}

void BlockProblem::Add(std::unique_ptr<ceres::CostFunction> cost, ceres::LossFunction* loss,
                       const std::vector<double*>& parameters) {
  problem_.AddResidualBlock(cost.get(), loss, parameters);
  costs_.push_back(std::move(cost));
}

ceres::LossFunction* BlockProblem::Scaled(double weight, const Loss& loss) {
  ceres::LossFunction*& scaled = scaled_[{weight, loss.kind, loss.width}];
  if (scaled == nullptr) {
    scaled = Own(std::make_unique<ceres::ScaledLoss>(loss.Soft().release(), weight, ceres::TAKE_OWNERSHIP));
  }
  return scaled;
}

ceres::LossFunction* BlockProblem::Own(std::unique_ptr<ceres::LossFunction> loss) {
  losses_.push_back(std::move(loss));
  return losses_.back().get();
}

}  // namespace spba
