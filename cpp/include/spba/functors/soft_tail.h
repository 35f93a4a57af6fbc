// The soft tails of spba/tails.h around any cost function with a known number of residuals.
#ifndef SPBA_FUNCTORS_SOFT_TAIL_H_
#define SPBA_FUNCTORS_SOFT_TAIL_H_

#include <ceres/cost_function.h>

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <utility>

#include "spba/tails.h"

namespace spba {
inline namespace v0 {
namespace functors {

// Changes what `inner` gives beyond `width`; its loss must be a SoftTailLoss of the same width around the
// robust loss of that width. Value and gradient of the objective stay what they are with the robust loss
// alone.
template <int kResiduals>
class SoftTail final : public ceres::CostFunction {
 public:
  SoftTail(std::unique_ptr<const ceres::CostFunction> inner, double width)
      : inner_(std::move(inner)), width_(width) {
    set_num_residuals(kResiduals);
    *mutable_parameter_block_sizes() = inner_->parameter_block_sizes();
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    if (!inner_->Evaluate(parameters, residuals, jacobians)) return false;
    const auto change = SoftenTail<kResiduals>(width_, residuals);
    if (jacobians == nullptr) return true;
    for (std::size_t block = 0; block < parameter_block_sizes().size(); ++block) {
      if (jacobians[block] == nullptr) continue;
      const int size = parameter_block_sizes()[block];
      for (int column = 0; column < size; ++column) {
        Eigen::Map<Eigen::Matrix<double, kResiduals, 1>, 0, Eigen::InnerStride<>> values(
            jacobians[block] + column, Eigen::InnerStride<>(size));
        values = (change * values).eval();
      }
    }
    return true;
  }

 private:
  const std::unique_ptr<const ceres::CostFunction> inner_;
  const double width_;
};

}  // namespace functors
}  // namespace v0
}  // namespace spba

#endif  // SPBA_FUNCTORS_SOFT_TAIL_H_
