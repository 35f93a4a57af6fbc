// Evaluating and minimising Eq. 9 with Ceres.
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>

#include "logs.h"
#include "problem.h"
#include "scaling.h"
#include "spba-ceres/src/bridge/ceres.rs.h"

namespace spba {
namespace {

double Total(const Terms& terms) {
  return terms.photometric + terms.silhouette + terms.inverse_depth + terms.style + terms.motion;
}

// Reports each iteration at Ceres's accepted state and remembers the best one.
class Reporter : public ceres::IterationCallback {
 public:
  Reporter(State* state, Observer* observer, std::function<Terms()> terms)
      : best(state->variables), state_(state), observer_(observer), terms_(std::move(terms)) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override {
    if (!state_->Update(false)) return ceres::SOLVER_ABORT;
    const Terms terms = terms_();
    if (Total(terms) <= best_cost_) {
      best_cost_ = Total(terms);
      best = state_->variables;
    }
    iterations = summary.iteration;
    const bool go_on = observer_->on_iteration({static_cast<uint32_t>(summary.iteration), terms,
                                                std::exp(state_->variables.log_alpha), summary.gradient_norm,
                                                state_->counts().residual, state_->counts().jacobian});
    interrupted = !go_on;
    return go_on ? ceres::SOLVER_CONTINUE : ceres::SOLVER_TERMINATE_SUCCESSFULLY;
  }

  Variables best;
  int iterations = 0;
  bool interrupted = false;

 private:
  State* state_;
  Observer* observer_;
  std::function<Terms()> terms_;
  double best_cost_ = std::numeric_limits<double>::infinity();
};

ceres::LinearSolverType ToCeres(LinearSolver solver) {
  switch (solver) {
    case LinearSolver::DenseSchur:
      return ceres::DENSE_SCHUR;
    case LinearSolver::SparseSchur:
      return ceres::SPARSE_SCHUR;
    case LinearSolver::IterativeSchur:
      return ceres::ITERATIVE_SCHUR;
    case LinearSolver::SparseNormalCholesky:
      return ceres::SPARSE_NORMAL_CHOLESKY;
    case LinearSolver::DenseNormalCholesky:
      return ceres::DENSE_NORMAL_CHOLESKY;
  }
  throw std::invalid_argument("no such linear solver");
}

ceres::LineSearchInterpolationType ToCeres(Interpolation interpolation) {
  switch (interpolation) {
    case Interpolation::Cubic:
      return ceres::CUBIC;
    case Interpolation::Quadratic:
      return ceres::QUADRATIC;
    case Interpolation::Bisection:
      return ceres::BISECTION;
  }
  throw std::invalid_argument("no such interpolation");
}

ceres::Solver::Options ToCeres(const SolveOptions& options, Variables* variables) {
  ceres::Solver::Options ceres_options;
  // One thread: with more, Ceres 2.1 adds costs up in the order in which threads happen to finish.
  ceres_options.num_threads = 1;
  ceres_options.max_num_iterations = static_cast<int>(options.max_iterations);
  ceres_options.function_tolerance = options.function_tolerance;
  // Only the objective's own progress stops a call; the scales of poses and style are too different.
  ceres_options.parameter_tolerance = 1e-12;
  ceres_options.gradient_tolerance = 1e-12;
  ceres_options.logging_type = ceres::SILENT;
  ceres_options.update_state_every_iteration = true;
  if (options.line_search) {
    ceres_options.minimizer_type = ceres::LINE_SEARCH;
    ceres_options.line_search_direction_type = ceres::LBFGS;
    ceres_options.line_search_type = ceres::WOLFE;
    ceres_options.line_search_interpolation_type = ToCeres(options.interpolation);
    ceres_options.max_lbfgs_rank = static_cast<int>(options.lbfgs_rank);
    return ceres_options;
  }
  ceres_options.minimizer_type = ceres::TRUST_REGION;
  ceres_options.initial_trust_region_radius = options.initial_trust_region_radius;
  ceres_options.max_num_consecutive_invalid_steps = 20;
  ceres_options.linear_solver_type = ToCeres(options.linear_solver);
  if (ceres::IsSchurType(ceres_options.linear_solver_type)) {
    auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    for (Vector6& motion : variables->motion) ordering->AddElementToGroup(motion.data(), 0);
    ordering->AddElementToGroup(variables->target_from_object.data(), 1);
    // A group of its own: Ceres orders the members of a group by their addresses, and the result would depend
    // on where they happen to lie.
    ordering->AddElementToGroup(variables->style.data(), 2);
    ordering->AddElementToGroup(&variables->log_alpha, 3);
    ceres_options.linear_solver_ordering = ordering;
  }
  return ceres_options;
}

void SetFree(ceres::Problem* problem, double* block, bool free) {
  if (free) {
    problem->SetParameterBlockVariable(block);
  } else {
    problem->SetParameterBlockConstant(block);
  }
}

}  // namespace

Terms Problem::CurrentTerms() const {
  return {objective_->PhotometricCost(), objective_->SilhouetteCost(), objective_->InverseDepthCost(),
          objective_->StyleCost(), objective_->MotionCost()};
}

Terms Problem::evaluate() {
  RouteLogs();
  Prepare(false);
  return CurrentTerms();
}

void Problem::gradient(rust::Slice<double> gradient) {
  RouteLogs();
  Prepare(true);
  Variables& variables = state_.variables;
  ceres::Problem::EvaluateOptions options;
  options.parameter_blocks.push_back(variables.target_from_object.data());
  for (Vector6& motion : variables.motion) options.parameter_blocks.push_back(motion.data());
  options.parameter_blocks.push_back(variables.style.data());
  options.parameter_blocks.push_back(&variables.log_alpha);
  for (double* block : options.parameter_blocks) SetFree(&objective_->problem(), block, true);
  std::vector<double> values;
  if (!objective_->problem().Evaluate(options, nullptr, nullptr, &values, nullptr)) {
    throw std::runtime_error("the objective could not be evaluated");
  }
  if (values.size() != gradient.size()) throw std::invalid_argument("the gradient has 6 L + S + 1 entries");
  std::copy(values.begin(), values.end(), gradient.data());
}

Summary Problem::solve(const SolveOptions& options, Observer& observer) {
  RouteLogs();
  Prepare(false);
  ceres::Problem& problem = objective_->problem();
  Variables& variables = state_.variables;
  SetFree(&problem, variables.target_from_object.data(), options.free_target);
  for (Vector6& motion : variables.motion) SetFree(&problem, motion.data(), options.free_motion);
  SetFree(&problem, variables.style.data(), options.free_style);
  SetFree(&problem, &variables.log_alpha, options.free_alpha);

  Reporter reporter(&state_, &observer, [this] { return CurrentTerms(); });
  ceres::Solver::Options ceres_options = ToCeres(options, &variables);
  ceres_options.callbacks.push_back(&reporter);
  std::string error;
  if (!ceres_options.IsValid(&error)) throw std::invalid_argument(error);

  std::optional<Scaling> scaling;
  if (options.line_search) {
    if (!state_.Update(true)) throw std::runtime_error(state_.failure());
    scaling.emplace(&problem);
  }
  state_.ResetCounts();
  // The scaling's is one Jacobian evaluation, whatever Ceres counted for its single blocks.
  if (scaling) state_.PrepareForEvaluation(true, false);
  ceres::Solver::Summary ceres_summary;
  ceres::Solve(ceres_options, &problem, &ceres_summary);
  const State::Counts counts = state_.counts();
  if (!state_.failure().empty()) throw std::runtime_error(state_.failure());

  variables = reporter.best;
  // Ceres calls a line search without a next step a failure; the best state stands all the same.
  return {static_cast<uint32_t>(reporter.iterations), counts.residual, counts.jacobian, reporter.interrupted};
}

}  // namespace spba
