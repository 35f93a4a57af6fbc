#include "core/minimise.h"

#include <ceres/ceres.h>

#include <cmath>
#include <exception>
#include <limits>
#include <numeric>
#include <optional>
#include <stdexcept>

#include "core/accumulated_cost.h"
#include "core/blocks.h"
#include "core/scaling.h"

namespace spba {
namespace {

ceres::LinearSolverType ToCeres(LinearSolver solver) {
  switch (solver) {
    case LinearSolver::kDenseSchur:
      return ceres::DENSE_SCHUR;
    case LinearSolver::kSparseSchur:
      return ceres::SPARSE_SCHUR;
    case LinearSolver::kIterativeSchur:
      return ceres::ITERATIVE_SCHUR;
    case LinearSolver::kSparseNormalCholesky:
      return ceres::SPARSE_NORMAL_CHOLESKY;
    case LinearSolver::kDenseNormalCholesky:
      return ceres::DENSE_NORMAL_CHOLESKY;
  }
  throw std::invalid_argument("no such linear solver");
}

ceres::LineSearchInterpolationType ToCeres(Interpolation interpolation) {
  switch (interpolation) {
    case Interpolation::kCubic:
      return ceres::CUBIC;
    case Interpolation::kQuadratic:
      return ceres::QUADRATIC;
    case Interpolation::kBisection:
      return ceres::BISECTION;
  }
  throw std::invalid_argument("no such interpolation");
}

// Poses but the target's first, then a group for each other block: Ceres orders the members of a group by
// their addresses, and the result would depend on where they happen to lie.
std::shared_ptr<ceres::ParameterBlockOrdering> SourcesFirst(const ceres::Problem& problem,
                                                            Coordinates* coordinates, int target) {
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  int group = 1;
  const bool each = coordinates->free().poses == PoseMotion::kEach;
  for (const Coordinates::Block& block : coordinates->blocks()) {
    double* const values = coordinates->Values(block);
    if (!problem.HasParameterBlock(values)) continue;
    const bool source = block.size == 6 && each && values < coordinates->StyleBlock() &&
                        values != coordinates->PoseBlock(target);
    ordering->AddElementToGroup(values, source ? 0 : group++);
  }
  return ordering;
}

ceres::Solver::Options ToCeres(const MinimiseOptions& options) {
  ceres::Solver::Options ceres_options;
  // One thread: with more, Ceres 2.1 adds costs up in the order in which threads happen to finish.
  ceres_options.num_threads = 1;
  ceres_options.max_num_iterations = options.max_iterations;
  // The callback stops a call by the objective's own progress: Ceres's share would be one of the shifted cost
  // (accumulated_cost.h), and the scales of poses and style are too different for the other two.
  ceres_options.function_tolerance = 0.0;
  ceres_options.parameter_tolerance = 1e-12;
  ceres_options.gradient_tolerance = 1e-12;
  ceres_options.logging_type = ceres::SILENT;
  ceres_options.update_state_every_iteration = true;
  if (options.line_search) {
    ceres_options.minimizer_type = ceres::LINE_SEARCH;
    ceres_options.line_search_direction_type = ceres::LBFGS;
    ceres_options.line_search_type = ceres::WOLFE;
    ceres_options.line_search_interpolation_type = ToCeres(options.interpolation);
    ceres_options.max_lbfgs_rank = options.lbfgs_rank;
    return ceres_options;
  }
  ceres_options.minimizer_type = ceres::TRUST_REGION;
  ceres_options.initial_trust_region_radius = options.initial_trust_region_radius;
  ceres_options.max_num_consecutive_invalid_steps = 20;
  ceres_options.linear_solver_type = options.evaluation == EvaluationKind::kBlocks
                                         ? ToCeres(options.linear_solver)
                                         : ceres::DENSE_NORMAL_CHOLESKY;
  return ceres_options;
}

double Total(const Costs& costs) { return std::accumulate(costs.begin(), costs.end(), 0.0); }

// Reports each iteration at Ceres's accepted state, remembers the best one, and stops where progress ends.
class Reporter : public ceres::IterationCallback {
 public:
  Reporter(Coordinates* coordinates, double tolerance, const IterationObserver& observer,
           std::function<Costs()> costs, const Counts& counts)
      : best(coordinates->values()),
        coordinates_(*coordinates),
        tolerance_(tolerance),
        observer_(observer),
        costs_(std::move(costs)),
        counts_(counts) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override try {
    const Costs costs = costs_();
    const double total = Total(costs);
    if (total <= best_cost_) {
      best_cost_ = total;
      best = coordinates_.values();
    }
    iterations = summary.iteration;
    trust_region_radius = summary.trust_region_radius;
    const Variables variables = coordinates_.Current();
    interrupted = !observer_({summary.iteration, costs, variables, summary.gradient_norm, counts_});
    const bool settled =
        summary.iteration > 0 && summary.step_is_valid && std::abs(summary.cost_change) <= tolerance_ * total;
    return interrupted || settled ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
  } catch (...) {
    // An exception must not unwind through Ceres.
    thrown = std::current_exception();
    return ceres::SOLVER_ABORT;
  }

  std::vector<double> best;
  int iterations = -1;
  double trust_region_radius = 0.0;
  bool interrupted = false;
  std::exception_ptr thrown;

 private:
  Coordinates& coordinates_;
  const double tolerance_;
  const IterationObserver& observer_;
  const std::function<Costs()> costs_;
  const Counts& counts_;
  double best_cost_ = std::numeric_limits<double>::infinity();
};

// Moves every free block in coordinates of unit curvature.
void Scale(ceres::Problem* problem, Coordinates* coordinates, const RowMajorMatrix& normal_matrix) {
  Eigen::Index at = 0;
  for (const Coordinates::Block& block : coordinates->blocks()) {
    double* const values = coordinates->Values(block);
    if (problem->HasParameterBlock(values)) {
      problem->SetManifold(values,
                           UnitCurvature(normal_matrix.block(at, at, block.size, block.size)).release());
    }
    at += block.size;
  }
}

}  // namespace

Outcome Minimise(const Objective& objective, const Visibility& visibility, const Free& free, int target,
                 const MinimiseOptions& options, const IterationObserver& observer, ShapeMemory* memory,
                 Variables* variables) {
  Coordinates coordinates(*variables, free, target);
  if (coordinates.blocks().empty()) return {};
  const auto evaluate = [&](Want::Order order) {
    Want want;
    want.order = order;
    Evaluation evaluation =
        objective.Evaluate(coordinates.Current(), visibility, want, options.threads, memory);
    if (!evaluation.ok()) throw std::runtime_error(evaluation.failure);
    return evaluation;
  };

  std::optional<BlockProblem> blocks;
  std::optional<AccumulatedCost> accumulated;
  std::optional<ceres::Problem> single;
  Counts counts;
  if (options.evaluation == EvaluationKind::kBlocks) {
    blocks.emplace(objective, visibility, &coordinates, &counts);
  } else {
    accumulated.emplace(
        objective, visibility, coordinates,
        options.line_search ? AccumulatedCost::For::kLineSearch : AccumulatedCost::For::kTrustRegion,
        options.threads, memory, &counts);
    ceres::Problem::Options problem_options;
    problem_options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    single.emplace(problem_options);
    std::vector<double*> parameters;
    for (const Coordinates::Block& block : coordinates.blocks()) {
      parameters.push_back(coordinates.Values(block));
    }
    single->AddResidualBlock(&*accumulated, nullptr, parameters);
  }
  ceres::Problem& problem = blocks ? blocks->problem() : *single;
  if (options.line_search) {
    Scale(&problem, &coordinates,
          coordinates.NormalMatrix(evaluate(Want::Order::kNormalMatrix).equations.matrix));
    ++counts.jacobian;
  }

  const auto costs = [&] {
    if (accumulated) {
      if (const auto known = accumulated->CostsAt(coordinates.values())) return *known;
    }
    return evaluate(Want::Order::kCost).equations.costs;
  };
  Reporter reporter(&coordinates, options.tolerance, observer, costs, counts);
  ceres::Solver::Options ceres_options = ToCeres(options);
  ceres_options.callbacks.push_back(&reporter);
  if (ceres::IsSchurType(ceres_options.linear_solver_type)) {
    ceres_options.linear_solver_ordering = SourcesFirst(problem, &coordinates, target);
  }
  std::string error;
  if (!ceres_options.IsValid(&error)) throw std::invalid_argument(error);
  ceres::Solver::Summary summary;
  ceres::Solve(ceres_options, &problem, &summary);
  if (reporter.thrown) std::rethrow_exception(reporter.thrown);
  if (reporter.iterations < 0) {
    // Not even the start had a value; why not is the evaluation's to say.
    evaluate(Want::Order::kNormalMatrix);
    throw std::runtime_error(summary.message);
  }

  // Ceres calls a line search without a next step a failure; the best state stands all the same.
  coordinates.SetValues(reporter.best);
  *variables = coordinates.Current();
  return {reporter.iterations, counts, reporter.interrupted, reporter.trust_region_radius};
}

}  // namespace spba
