// Soft tails: the loss's value and gradient stay, its Gauss-Newton curvature along the residual falls, across
// it stays. Prints what differs; exits with the number of failures.
#include "spba/tails.h"

#include <ceres/loss_function.h>

#include <Eigen/Core>
#include <cmath>
#include <cstdio>
#include <memory>

namespace {

int failures = 0;

void Expect(const char* what, double found, double expected) {
  if (std::abs(found - expected) <= 1e-8 * (1.0 + std::abs(expected))) return;
  std::fprintf(stderr, "%s: %.12g, expected %.12g\n", what, found, expected);
  ++failures;
}

template <typename Loss>
void Check(double width) {
  const Loss plain(width);
  const spba::SoftTailLoss soft(std::make_unique<Loss>(width), width);
  const Eigen::Vector3d direction = Eigen::Vector3d(1.0, -2.0, 0.5).normalized();
  const Eigen::Vector3d aside = Eigen::Vector3d(2.0, 1.0, 0.0).normalized();
  for (const double ratio : {0.0, 0.5, 0.999999, 1.0, 1.000001, 1.5, 10.0, 1000.0}) {
    const Eigen::Vector3d residual = ratio * width * direction;
    Eigen::Vector3d softened = residual;
    const Eigen::Matrix3d by_residual = spba::SoftenTail<3>(width, softened.data());
    double rho[3], soft_rho[3];
    plain.Evaluate(residual.squaredNorm(), rho);
    soft.Evaluate(softened.squaredNorm(), soft_rho);
    Expect("value", soft_rho[0], rho[0]);
    // Of half the loss, by the residual.
    const Eigen::Vector3d gradient = soft_rho[1] * by_residual.transpose() * softened;
    Expect("gradient", (gradient - rho[1] * residual).norm(), 0.0);
    const Eigen::Matrix3d curvature = soft_rho[1] * by_residual.transpose() * by_residual;
    const double expected = ratio > 1.0 ? spba::kTailCurvature * rho[1] : rho[1];
    Expect("curvature along", direction.dot(curvature * direction), expected);
    Expect("curvature across", aside.dot(curvature * aside), rho[1]);
  }
}

}  // namespace

int main() {
  Check<ceres::HuberLoss>(20.0);
  Check<ceres::HuberLoss>(0.003);
  Check<ceres::CauchyLoss>(1.0);
  return failures;
}
