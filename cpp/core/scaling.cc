#include "core/scaling.h"

#include <Eigen/Cholesky>

#include "core/geometry.h"

namespace spba {
namespace {

// Less curvature than this share of a block's mean is treated as if it were that.
constexpr double kMinCurvature = 1e-6;

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
  Eigen::Map<RowMajorMatrix> Matrix(double* data) const {
    return {data, transform_.rows(), transform_.rows()};
  }

  RowMajorMatrix transform_, inverse_;
};

}  // namespace

std::unique_ptr<ceres::Manifold> UnitCurvature(const Eigen::MatrixXd& hessian) {
  Eigen::MatrixXd regular = hessian;
  const double mean = hessian.trace() / static_cast<double>(hessian.rows());
  regular.diagonal().array() += mean > 0.0 ? kMinCurvature * mean : 1.0;
  return std::make_unique<LinearManifold>(regular);
}

}  // namespace spba
