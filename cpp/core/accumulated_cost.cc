#include "core/accumulated_cost.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>

namespace spba {

SquareRoot::SquareRoot(const RowMajorMatrix& matrix, const Eigen::VectorXd& gradient) {
  const Eigen::Index n = matrix.rows();
  // In units in which the diagonal is 1: a radian, a diagonal and a style differ by orders of magnitude. A
  // variable that nothing depends on keeps a zero column.
  const Eigen::VectorXd unit = matrix.diagonal().cwiseMax(0.0).cwiseSqrt();
  const Eigen::VectorXd per_unit = unit.unaryExpr([](double u) { return u > 0.0 ? 1.0 / u : 0.0; });
  Eigen::MatrixXd scaled = per_unit.asDiagonal() * matrix * per_unit.asDiagonal();
  for (Eigen::Index i = 0; i < n; ++i) {
    if (unit[i] == 0.0) scaled(i, i) = 1.0;
  }
  const Eigen::VectorXd scaled_gradient = per_unit.asDiagonal() * gradient;
  const Eigen::LLT<Eigen::MatrixXd> cholesky(scaled);
  // A pivot is the share of a variable's curvature that no other variable explains.
  constexpr double kSingular = 1e-12;
  if (cholesky.info() == Eigen::Success &&
      cholesky.matrixLLT().diagonal().minCoeff() > std::sqrt(kSingular)) {
    root = cholesky.matrixU();
    residual = cholesky.matrixL().solve(scaled_gradient);
  } else {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled);
    const Eigen::VectorXd scale = eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt();
    root = scale.asDiagonal() * eigen.eigenvectors().transpose();
    residual = eigen.eigenvectors().transpose() * scaled_gradient;
    for (Eigen::Index i = 0; i < n; ++i) {
      residual[i] = eigen.eigenvalues()[i] > kSingular ? residual[i] / scale[i] : 0.0;
    }
  }
  root = root * unit.asDiagonal();
}

AccumulatedCost::AccumulatedCost(const Objective& objective, const Visibility& visibility,
                                 const Coordinates& coordinates, For minimiser, int threads,
                                 ShapeMemory* memory, Counts* counts)
    : objective_(objective),
      visibility_(visibility),
      for_(minimiser),
      threads_(threads),
      memory_(memory),
      counts_(counts),
      at_(coordinates),
      last_{"", NormalEquations(Layout{}, Want{})} {
  for (const Coordinates::Block& block : coordinates.blocks()) {
    mutable_parameter_block_sizes()->push_back(block.size);
  }
  set_num_residuals(minimiser == For::kLineSearch ? 1 : coordinates.free_count() + 1);
}

bool AccumulatedCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  ++(jacobians == nullptr ? counts_->residual : counts_->jacobian);
  at_.SetBlocks(parameters);
  const bool line_search = for_ == For::kLineSearch;
  if (line_search || last_values_ != at_.values()) {
    Want want;
    want.order = !line_search           ? Want::Order::kNormalMatrix
                 : jacobians == nullptr ? Want::Order::kCost
                                        : Want::Order::kGradient;
    want.style = at_.free().style;
    want.focal = at_.free().log_focal;
    last_ = objective_.Evaluate(at_.Current(), visibility_, want, threads_, memory_);
    last_values_ = at_.values();
    if (last_.ok()) recent_.emplace_back(at_.values(), last_.equations.costs);
  }
  const Evaluation& evaluation = last_;
  if (!evaluation.ok()) return false;
  const double cost = evaluation.Cost();
  if (!shift_) shift_ = line_search ? 0.0 : (1.0 / kTailCurvature - 1.0) * cost;

  const Eigen::Index n = at_.free_count();
  RowMajorMatrix jacobian;
  if (line_search) {
    residuals[0] = std::sqrt(2.0 * cost);
    if (jacobians == nullptr) return true;
    const Eigen::VectorXd gradient = at_.Gradient(evaluation.equations.gradient);
    jacobian = residuals[0] > 0.0 ? RowMajorMatrix(gradient.transpose() / residuals[0])
                                  : RowMajorMatrix(RowMajorMatrix::Zero(1, n));
  } else {
    const double squared = 2.0 * (cost + *shift_);
    Eigen::Map<Eigen::VectorXd> residual(residuals, n + 1);
    residual.setZero();
    residual[n] = std::sqrt(squared);
    if (jacobians == nullptr) return true;
    const SquareRoot square_root(at_.NormalMatrix(evaluation.equations.matrix),
                                 at_.Gradient(evaluation.equations.gradient));
    const double rest = squared - square_root.residual.squaredNorm();
    if (!(rest >= -1e-9 * squared)) return false;
    residual.head(n) = square_root.residual;
    residual[n] = std::sqrt(std::max(0.0, rest));
    jacobian.setZero(n + 1, n);
    jacobian.topRows(n) = square_root.root;
  }
  Eigen::Index column = 0;
  for (size_t i = 0; i < at_.blocks().size(); ++i) {
    const int size = at_.blocks()[i].size;
    if (jacobians[i] != nullptr) {
      Eigen::Map<RowMajorMatrix>(jacobians[i], jacobian.rows(), size) = jacobian.middleCols(column, size);
    }
    column += size;
  }
  return true;
}

std::optional<Costs> AccumulatedCost::CostsAt(const std::vector<double>& values) const {
  std::optional<Costs> found;
  for (const auto& [where, costs] : recent_) {
    if (where == values) found = costs;
  }
  recent_.clear();
  if (found) recent_.emplace_back(values, *found);
  return found;
}

}  // namespace spba
