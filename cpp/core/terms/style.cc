#include "core/terms/style.h"

#include <ceres/normal_prior.h>

#include "core/blocks.h"
#include "spba/style.h"

namespace spba {
namespace {

class StyleTerm : public Term {
 public:
  explicit StyleTerm(const StyleOptions& options) : options_(options) {}

  void AddWhole(const Variables& variables, const Layout& layout, Want want,
                NormalEquations* sums) const override {
    const Eigen::Map<const Eigen::VectorXd> style(variables.style.data(), layout.styles);
    const double s = style.squaredNorm();
    double rho[3];
    StyleLoss(options_.reach).Evaluate(s, rho);
    sums->costs[kStyle] += 0.5 * options_.weight * rho[0];
    if (!want.derivatives()) return;
    const double slope = options_.weight * rho[1];
    sums->gradient.segment(layout.style(), layout.styles) += slope * style;
    if (!want.normal_matrix()) return;
    auto block = sums->matrix.block(layout.style(), layout.style(), layout.styles, layout.styles);
    block.diagonal().array() += slope;
    // Beyond the reach the loss is convex: Ceres adds the curvature along the style (Triggs et al.).
    if (rho[2] > 0.0) block += 2.0 * options_.weight * rho[2] * style * style.transpose();
  }

  void AddBlocks(const Visibility&, BlockProblem* problem) const override {
    const int styles = problem->state().objective().prior().style_count;
    problem->Add(std::make_unique<ceres::NormalPrior>(ceres::Matrix::Identity(styles, styles),
                                                      ceres::Vector::Zero(styles)),
                 problem->Own(std::make_unique<ceres::ScaledLoss>(new StyleLoss(options_.reach),
                                                                  options_.weight, ceres::TAKE_OWNERSHIP)),
                 {problem->state().coordinates().StyleBlock()});
  }

 private:
  const StyleOptions options_;
};

}  // namespace

std::unique_ptr<const Term> MakeStyleTerm(const StyleOptions& options) {
  return std::make_unique<StyleTerm>(options);
}

}  // namespace spba
