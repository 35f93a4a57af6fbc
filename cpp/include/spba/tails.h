// Robust losses whose tails do not brake Gauss-Newton.
//
// Beyond its width a robust loss is linear or flatter: along the residual it has no curvature. Ceres's
// Gauss-Newton puts rho' there, the curvature of a square with that weight. Where many residuals lie in the
// tails, as they do for a shape that fits nowhere exactly, that is many times too much, and each step is a
// fraction of what it could be: the cost then falls by twice what the model predicted, iteration after
// iteration.
//
// The same cost in another coordinate does better. With r the residual's norm and w the loss's width, let
// t = w (r / w)^e beyond w and t = r within, and let the loss of t^2 be that of r^2. Value and gradient are
// the same; Gauss-Newton's curvature along the residual is e times what it was, that across it is unchanged.
#ifndef SPBA_TAILS_H_
#define SPBA_TAILS_H_

#include <ceres/loss_function.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

namespace spba {

// e. Small, but not 0: the steps stay bounded where all residuals lie in the tails.
constexpr double kTailCurvature = 0.1;

// The loss of what SoftenTail makes of a residual, `inner` being the loss of the residual itself.
class SoftTailLoss : public ceres::LossFunction {
 public:
  SoftTailLoss(std::unique_ptr<ceres::LossFunction> inner, double width)
      : inner_(std::move(inner)), squared_width_(width * width) {}

  void Evaluate(double s, double rho[3]) const override {
    if (s <= squared_width_) {
      inner_->Evaluate(s, rho);
      return;
    }
    constexpr double kPower = 1.0 / kTailCurvature;
    const double ratio = std::pow(s / squared_width_, kPower - 1.0);
    inner_->Evaluate(s * ratio, rho);
    rho[1] *= kPower * ratio;
    // Ceres would undo the coordinate's change with the second derivative.
    rho[2] = 0.0;
  }

 private:
  const std::unique_ptr<ceres::LossFunction> inner_;
  const double squared_width_;
};

// Changes a residual to that of SoftTailLoss with the same width, in place. Returns the matrix by which its
// Jacobian is to be multiplied: the change's derivative along the residual; across it, where the gradient
// does not look, what keeps the curvature.
template <int kResiduals>
Eigen::Matrix<double, kResiduals, kResiduals> SoftenTail(double width, double* residuals) {
  using Square = Eigen::Matrix<double, kResiduals, kResiduals>;
  Eigen::Map<Eigen::Matrix<double, kResiduals, 1>> residual(residuals);
  const double norm = residual.norm();
  // The loss tells the tail by the norm: on the border, rounding must not put the two on different sides.
  if (norm <= (1.0 + 1e-9) * width) {
    residual *= std::min(1.0, (1.0 - 1e-12) * width / norm);
    return Square::Identity();
  }
  const Eigen::Matrix<double, kResiduals, 1> along = residual / norm;
  const double factor = std::pow(norm / width, kTailCurvature - 1.0);
  residual *= factor;
  const double across = std::sqrt(kTailCurvature);
  return factor * (across * Square::Identity() + (kTailCurvature - across) * along * along.transpose());
}

}  // namespace spba

#endif  // SPBA_TAILS_H_
