#include "core/terms/style.h"

#include <ceres/loss_function.h>
#include <ceres/normal_prior.h>

#include "core/blocks.h"

namespace spba {
namespace {

class StyleTerm : public Term {
 public:
  explicit StyleTerm(const StyleOptions& options) : weight_(options.weight) {}

  void AddWhole(const Variables& variables, const Layout& layout, Want want,
                NormalEquations* sums) const override {
    const Eigen::Map<const Eigen::VectorXd> style(variables.style.data(), layout.styles);
    sums->costs[kStyle] += 0.5 * weight_ * style.squaredNorm();
    if (!want.derivatives()) return;
    sums->gradient.segment(layout.style(), layout.styles) += weight_ * style;
    if (!want.normal_matrix()) return;
    sums->matrix.diagonal().segment(layout.style(), layout.styles).array() += weight_;
  }

  void AddBlocks(const Visibility&, BlockProblem* problem) const override {
    const int styles = problem->state().objective().prior().style_count;
    problem->Add(std::make_unique<ceres::NormalPrior>(ceres::Matrix::Identity(styles, styles),
                                                      ceres::Vector::Zero(styles)),
                 problem->Own(std::make_unique<ceres::ScaledLoss>(nullptr, weight_, ceres::TAKE_OWNERSHIP)),
                 {problem->state().coordinates().StyleBlock()});
  }

 private:
  const double weight_;
};

}  // namespace

std::unique_ptr<const Term> MakeStyleTerm(const StyleOptions& options) {
  return std::make_unique<StyleTerm>(options);
}

}  // namespace spba
