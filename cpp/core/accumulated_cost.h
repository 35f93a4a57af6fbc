// The whole objective as one ceres::CostFunction.
#ifndef SPBA_CORE_ACCUMULATED_COST_H_
#define SPBA_CORE_ACCUMULATED_COST_H_

#include <ceres/cost_function.h>

#include <optional>
#include <utility>
#include <vector>

#include "core/coordinates.h"
#include "core/objective.h"

namespace spba {

// R with R^T R = matrix (symmetric, positive semidefinite), and R^-T gradient where R has an inverse, zero
// across.
struct SquareRoot {
  RowMajorMatrix root;
  Eigen::VectorXd residual;

  SquareRoot(const RowMajorMatrix& matrix, const Eigen::VectorXd& gradient);
};

// Hands Ceres cost c, gradient g and Gauss-Newton matrix H of the objective: with H = R^T R, the residual
// [R^-T g; sqrt(2 (c + shift) - |R^-T g|^2)] and the Jacobian [R; 0] have just these, the cost up to the
// shift. So Levenberg-Marquardt takes the steps that it would take with a residual block each.
//
// Soft tails have less curvature than a sum of squares of that value and gradient, so that |R^-T g|^2 may
// exceed 2 c, by a factor of 1 / kTailCurvature at most. A shift of (1 / kTailCurvature - 1) c makes up for
// it; c at the start, where the first evaluation is, will do: a trust region asks for derivatives where the
// cost is no higher alone.
//
// Most steps of a trust region are accepted, and derivatives are then asked for where the cost was: they are
// found together, and kept.
//
// For a line search, which looks at cost and gradient alone, the residual is sqrt(2 c) and the shift 0.
class AccumulatedCost : public ceres::CostFunction {
 public:
  enum class For { kTrustRegion, kLineSearch };
  AccumulatedCost(const Objective& objective, const Visibility& visibility, const Coordinates& coordinates,
                  For minimiser, int threads, ShapeMemory* memory, Counts* counts);

  // The parameters are the free blocks of the coordinates, in their order.
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

  // By term, at values of the coordinates that were evaluated since the last call, or are those of the last
  // call.
  std::optional<Costs> CostsAt(const std::vector<double>& values) const;

 private:
  const Objective& objective_;
  const Visibility& visibility_;
  const For for_;
  const int threads_;
  ShapeMemory* const memory_;
  Counts* const counts_;
  // Evaluate is const for Ceres's sake; one thread calls it.
  mutable Coordinates at_;
  mutable std::vector<double> last_values_;
  mutable Evaluation last_;
  mutable std::optional<double> shift_;
  mutable std::vector<std::pair<std::vector<double>, Costs>> recent_;
};

}  // namespace spba

#endif  // SPBA_CORE_ACCUMULATED_COST_H_
