// What a term's weight, robust loss and soft tail make of a residual.
#ifndef SPBA_CORE_LOSS_H_
#define SPBA_CORE_LOSS_H_

#include <Eigen/Core>
#include <cmath>
#include <limits>
#include <memory>

#include "spba/tails.h"

namespace spba {

// weight / 2 rho(|r|^2), with the tail of tails.h beyond the width.
struct Loss {
  enum class Kind { kSquare, kHuber, kCauchy };
  Kind kind = Kind::kSquare;
  double width = 0.0;

  // rho and rho' at s = |r|^2.
  void Evaluate(double s, double* rho, double* slope) const {
    const double squared_width = width * width;
    *rho = s;
    *slope = 1.0;
    if (kind == Kind::kCauchy) {
      *rho = squared_width * std::log1p(s / squared_width);
      *slope = 1.0 / (1.0 + s / squared_width);
    } else if (kind == Kind::kHuber && s > squared_width) {
      const double norm = std::sqrt(s);
      *rho = 2.0 * width * norm - squared_width;
      *slope = width / norm;
    }
  }

  // The same as a ceres::LossFunction of what SoftenTail makes of a residual; null where there is none.
  std::unique_ptr<ceres::LossFunction> Soft() const {
    switch (kind) {
      case Kind::kSquare:
        return nullptr;
      case Kind::kHuber:
        return std::make_unique<SoftTailLoss>(std::make_unique<ceres::HuberLoss>(width), width);
      case Kind::kCauchy:
        return std::make_unique<SoftTailLoss>(std::make_unique<ceres::CauchyLoss>(width), width);
    }
    return nullptr;
  }
  // The width that SoftenTail takes.
  double SoftWidth() const { return kind == Kind::kSquare ? std::numeric_limits<double>::infinity() : width; }
};

// Cost, gradient by the residual and Gauss-Newton curvature: as Ceres sees SoftTailLoss of SoftenTail, in
// closed form. In the tail the curvature along the residual is kTailCurvature times that of a square with the
// same slope; across it is unchanged.
template <int kResiduals>
struct Weighed {
  using Residual = Eigen::Matrix<double, kResiduals, 1>;
  double cost;
  Residual slope;
  double across;  // curvature = across (I - less_along residual residual^T)
  double less_along;

  Weighed(const Loss& loss, double weight, const Residual& residual) {
    const double s = residual.squaredNorm();
    double rho, first;
    loss.Evaluate(s, &rho, &first);
    cost = 0.5 * weight * rho;
    across = weight * first;
    slope = across * residual;
    less_along =
        loss.kind != Loss::Kind::kSquare && s > loss.width * loss.width ? (1.0 - kTailCurvature) / s : 0.0;
  }
};

}  // namespace spba

#endif  // SPBA_CORE_LOSS_H_
