// How plausible a style is: the loss of a standard normal one, with a wall around the plausible.
#ifndef SPBA_STYLE_H_
#define SPBA_STYLE_H_

#include <ceres/loss_function.h>

#include <cmath>

namespace spba {

// Of the squared norm of a style: rho = |s|^2 up to `reach`, kWall (|s| - reach)^2 more beyond. 1/2 rho is
// -log p(s) within. Standard normal styles of S entries are sqrt(S) long, and hardly any longer than half as
// much again; where a shape fits nowhere, a normal density alone lets it run twice as far. reach 0 = no wall.
class StyleLoss : public ceres::LossFunction {
 public:
  static constexpr double kWall = 100.0;

  explicit StyleLoss(double reach) : reach_(reach) {}

  void Evaluate(double s, double rho[3]) const override {
    rho[0] = s;
    rho[1] = 1.0;
    rho[2] = 0.0;
    const double norm = std::sqrt(s), beyond = norm - reach_;
    if (reach_ == 0.0 || beyond <= 0.0) return;
    rho[0] += kWall * beyond * beyond;
    rho[1] += kWall * beyond / norm;
    rho[2] += 0.5 * kWall * reach_ / (s * norm);
  }

 private:
  double reach_;
};

}  // namespace spba

#endif  // SPBA_STYLE_H_
