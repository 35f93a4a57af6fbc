#include "core/terms/focal.h"

#include <ceres/normal_prior.h>

#include "core/blocks.h"

namespace spba {
namespace {

class FocalTerm : public Term {
 public:
  explicit FocalTerm(const FocalOptions& options)
      : information_(1.0 / (options.deviation * options.deviation)) {}

  void AddWhole(const Variables& variables, const Layout& layout, Want want,
                NormalEquations* sums) const override {
    const double x = variables.log_focal;
    sums->costs[kFocal] += 0.5 * information_ * x * x;
    const int at = layout.log_focal();
    if (want.derivatives()) sums->gradient[at] += information_ * x;
    if (want.normal_matrix()) sums->matrix(at, at) += information_;
  }

  void AddBlocks(const Visibility&, BlockProblem* problem) const override {
    problem->Add(std::make_unique<ceres::NormalPrior>(ceres::Matrix::Constant(1, 1, std::sqrt(information_)),
                                                      ceres::Vector::Zero(1)),
                 nullptr, {problem->state().coordinates().LogFocalBlock()});
  }

 private:
  const double information_;
};

}  // namespace

std::unique_ptr<const Term> MakeFocalTerm(const FocalOptions& options) {
  return std::make_unique<FocalTerm>(options);
}

}  // namespace spba
