#include "scaling.h"

#include <ceres/manifold.h>

#include <Eigen/Cholesky>
#include <map>

namespace spba {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Blocks with less curvature than this share of their mean are treated as if they had it.
constexpr double kLeastCurvature = 1e-6;

// x + T delta for a fixed regular T.
class LinearManifold : public ceres::Manifold {
 public:
  // T with T^T hessian T = 1.
  explicit LinearManifold(const Eigen::MatrixXd& hessian) {
    const Eigen::LLT<Eigen::MatrixXd> cholesky(hessian);
    inverse_ = cholesky.matrixU();
    transform_ = cholesky.matrixU().solve(Eigen::MatrixXd::Identity(hessian.rows(), hessian.cols()));
  }

  int AmbientSize() const override { return static_cast<int>(transform_.rows()); }
  int TangentSize() const override { return static_cast<int>(transform_.rows()); }

  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override {
    Vector(x_plus_delta) = ConstVector(x) + transform_ * ConstVector(delta);
    return true;
  }
  bool PlusJacobian(const double*, double* jacobian) const override {
    Matrix(jacobian) = transform_;
    return true;
  }
  bool Minus(const double* y, const double* x, double* y_minus_x) const override {
    Vector(y_minus_x) = inverse_ * (ConstVector(y) - ConstVector(x));
    return true;
  }
  bool MinusJacobian(const double*, double* jacobian) const override {
    Matrix(jacobian) = inverse_;
    return true;
  }

 private:
  Eigen::Map<Eigen::VectorXd> Vector(double* data) const { return {data, transform_.rows()}; }
  Eigen::Map<const Eigen::VectorXd> ConstVector(const double* data) const {
    return {data, transform_.rows()};
  }
  Eigen::Map<RowMajor> Matrix(double* data) const { return {data, transform_.rows(), transform_.rows()}; }

  RowMajor transform_, inverse_;
};

}  // namespace

Scaling::Scaling(ceres::Problem* problem) : problem_(problem) {
  std::vector<double*> all;
  problem->GetParameterBlocks(&all);
  std::map<const double*, Eigen::MatrixXd> hessians;
  for (double* block : all) {
    if (problem->IsParameterBlockConstant(block)) continue;
    const int size = problem->ParameterBlockSize(block);
    hessians[block] = Eigen::MatrixXd::Zero(size, size);
    blocks_.push_back(block);
  }

  std::vector<ceres::ResidualBlockId> residual_blocks;
  problem->GetResidualBlocks(&residual_blocks);
  std::vector<double*> parameters;
  std::vector<double> residuals;
  std::vector<std::vector<double>> jacobians;
  std::vector<double*> pointers;
  for (const ceres::ResidualBlockId id : residual_blocks) {
    problem->GetParameterBlocksForResidualBlock(id, &parameters);
    const int rows = problem->GetCostFunctionForResidualBlock(id)->num_residuals();
    residuals.resize(rows);
    jacobians.resize(parameters.size());
    pointers.resize(parameters.size());
    for (size_t i = 0; i < parameters.size(); ++i) {
      jacobians[i].resize(rows * problem->ParameterBlockSize(parameters[i]));
      pointers[i] = hessians.count(parameters[i]) > 0 ? jacobians[i].data() : nullptr;
    }
    double cost;
    if (!problem->EvaluateResidualBlockAssumingParametersUnchanged(id, true, &cost, residuals.data(),
                                                                   pointers.data())) {
      continue;
    }
    for (size_t i = 0; i < parameters.size(); ++i) {
      if (pointers[i] == nullptr) continue;
      const Eigen::Map<const RowMajor> jacobian(pointers[i], rows,
                                                problem->ParameterBlockSize(parameters[i]));
      hessians[parameters[i]].selfadjointView<Eigen::Lower>().rankUpdate(jacobian.transpose());
    }
  }

  for (double* block : blocks_) {
    Eigen::MatrixXd hessian = hessians[block].selfadjointView<Eigen::Lower>();
    const double mean = hessian.trace() / hessian.rows();
    hessian.diagonal().array() += mean > 0 ? kLeastCurvature * mean : 1.0;
    problem->SetManifold(block, new LinearManifold(hessian));
  }
}

Scaling::~Scaling() {
  for (double* block : blocks_) problem_->SetManifold(block, nullptr);
}

}  // namespace spba
