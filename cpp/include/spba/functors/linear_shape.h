// The shape prior as functors see it: X(s) = mean + basis s.
#ifndef SPBA_FUNCTORS_LINEAR_SHAPE_H_
#define SPBA_FUNCTORS_LINEAR_SHAPE_H_

#include <Eigen/Core>
#include <cstdint>
#include <stdexcept>
#include <utility>
#include <vector>

#include "spba/spba.hpp"

namespace spba {
inline namespace v0 {
namespace functors {

// Never changes, so that cost functions on any number of threads share one. It must outlive them.
class LinearShape {
 public:
  using Rows = Eigen::Map<const Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor>>;

  // `mean` has 3 N entries, `basis` 3 N rows of S, row-major.
  LinearShape(std::vector<double> mean, std::vector<double> basis)
      : mean_(std::move(mean)),
        basis_(std::move(basis)),
        style_count_(mean_.empty() ? 0 : static_cast<int>(basis_.size() / mean_.size())) {
    if (mean_.empty() || mean_.size() % 3 != 0 || style_count_ == 0 ||
        basis_.size() != mean_.size() * static_cast<std::size_t>(style_count_)) {
      throw std::invalid_argument("a linear shape: give 3 N means and 3 N rows of the basis");
    }
  }

  // The first `point_count` points of `prior`, all where there are fewer; any first part is an even sample.
  static LinearShape Of(const Prior& prior, std::size_t point_count) {
    if (!prior.is_linear()) throw std::invalid_argument("the prior is a decoder: give a linear one");
    const std::vector<double> zero(prior.style_count(), 0.0);
    std::vector<double> mean(3 * std::min(point_count, prior.point_count())), basis;
    prior.Evaluate(zero, &mean, &basis);
    return LinearShape(std::move(mean), std::move(basis));
  }

  int style_count() const { return style_count_; }
  int point_count() const { return static_cast<int>(mean_.size() / 3); }

  // dX_j/ds, 3 x S.
  Rows Basis(std::uint32_t j) const {
    return Rows(&basis_[3 * std::size_t{j} * static_cast<std::size_t>(style_count_)], 3, style_count_);
  }
  // X_j(s).
  Eigen::Vector3d Point(std::uint32_t j, const double* style) const {
    return Eigen::Map<const Eigen::Vector3d>(&mean_[3 * std::size_t{j}]) +
           Basis(j) * Eigen::Map<const Eigen::VectorXd>(style, style_count_);
  }

 private:
  std::vector<double> mean_, basis_;
  int style_count_;
};

}  // namespace functors
}  // namespace v0
}  // namespace spba

#endif  // SPBA_FUNCTORS_LINEAR_SHAPE_H_
