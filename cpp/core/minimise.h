// Minimising the objective with Ceres.
#ifndef SPBA_CORE_MINIMISE_H_
#define SPBA_CORE_MINIMISE_H_

#include <functional>

#include "core/coordinates.h"
#include "core/objective.h"

namespace spba {

// How the objective is evaluated for Ceres.
enum class EvaluationKind {
  kAccumulated,  // as one cost function (accumulated_cost.h)
  kBlocks,       // as a residual block each (blocks.h)
};

// The Schur solvers eliminate all poses but the target's: no two of these may share a residual.
enum class LinearSolver {
  kDenseSchur,
  kSparseSchur,
  kIterativeSchur,
  kSparseNormalCholesky,
  kDenseNormalCholesky,
};
enum class Interpolation { kCubic, kQuadratic, kBisection };

struct MinimiseOptions {
  EvaluationKind evaluation = EvaluationKind::kAccumulated;
  // L-BFGS instead of Levenberg-Marquardt.
  bool line_search = false;
  int lbfgs_rank = 20;
  Interpolation interpolation = Interpolation::kCubic;
  double initial_trust_region_radius = 1e4;
  // Of Levenberg-Marquardt over blocks. The accumulated normal equations are dense.
  LinearSolver linear_solver = LinearSolver::kSparseNormalCholesky;
  int max_iterations = 20;
  // Stop once an iteration changes the objective by a smaller share.
  double tolerance = 1e-4;
  // Of the accumulated evaluation; the bytes do not depend on it.
  int threads = 1;
};

// The state after one of Ceres's iterations; 0 is the start.
struct IterationState {
  int number;
  Costs costs;
  const Variables& variables;
  double gradient_norm;
  Counts counts;
};

// False stops there. Exceptions pass through Ceres to the caller of Minimise.
using IterationObserver = std::function<bool(const IterationState&)>;

struct Outcome {
  int iterations = 0;
  Counts counts;
  // The observer asked for it.
  bool interrupted = false;
  // After the last iteration; 0 of L-BFGS.
  double trust_region_radius = 0.0;
};

// Moves `variables` to the best state found, whatever ended the call. Throws where the objective has no value
// at the start, or an option is not Ceres's; an evaluation that fails later is a step not taken.
Outcome Minimise(const Objective& objective, const Visibility& visibility, const Free& free, int target,
                 const MinimiseOptions& options, const IterationObserver& observer, ShapeMemory* memory,
                 Variables* variables);

}  // namespace spba

#endif  // SPBA_CORE_MINIMISE_H_
