#include "core/terms/inverse_depth.h"

#include "core/blocks.h"

namespace spba {
namespace {

using Scalar = Eigen::Matrix<double, 1, 1>;
using Row3 = Eigen::Matrix<double, 1, 3>;

// The residual with its derivatives by the point's position and log alpha.
struct Linearised {
  double residual;
  Row3 by_position;
  double by_log_alpha;

  Linearised(const InverseDepthError& error, const Vector3& position, double alpha) {
    using Jet = ceres::Jet<double, 4>;
    const Jet jets[3] = {Jet(position[0], 0), Jet(position[1], 1), Jet(position[2], 2)};
    const Jet alpha_jet(alpha, 3);
    Jet output(kNotEvaluated);
    error(jets, &alpha_jet, &output);
    residual = output.a;
    by_position = output.v.head<3>().transpose();
    by_log_alpha = output.v[3] * alpha;
  }
};

class InverseDepthVisit : public Visit {
 public:
  InverseDepthVisit(const Visibility& visibility, const Loss& loss, double weight, double alpha)
      : visibility_(visibility), loss_(loss), weight_(weight), alpha_(alpha) {}

  void AddPoint(int j, PointSystem* system) const override {
    for (const SeenDepth* seen = visibility_.depths.begin(j); seen != visibility_.depths.end(j); ++seen) {
      PointView& view = system->View(static_cast<int>(seen->frame));
      if (!system->with_derivatives()) {
        double residual = kNotEvaluated;
        seen->error(view.position.data(), &alpha_, &residual);
        system->costs()[kInverseDepth] += Weighed<1>(loss_, weight_ * seen->weight, Scalar(residual)).cost;
        continue;
      }
      const Linearised at(seen->error, view.position, alpha_);
      const Weighed<1> weighed(loss_, weight_ * seen->weight, Scalar(at.residual));
      system->costs()[kInverseDepth] += weighed.cost;
      system->AddWithAlpha(&view, weighed, at.residual, at.by_position, at.by_log_alpha);
    }
  }

 private:
  const Visibility& visibility_;
  const Loss& loss_;
  const double weight_, alpha_;
};

class InverseDepthBlock : public Block<1> {
 public:
  InverseDepthBlock(const BlockState& state, const SeenDepth& seen, double width, int point)
      : Block(state, {static_cast<int>(seen.frame)}, width, true), point_(point), error_(seen.error) {}

  bool Evaluate(double const* const*, double* residuals, double** jacobians) const override {
    if (!state_.usable()) return false;
    const Vector3 position = InCamera(0, point_);
    const double alpha = Alpha();
    if (jacobians == nullptr) {
      if (!error_(position.data(), &alpha, residuals)) return false;
      Soften(residuals);
      return true;
    }
    const Linearised at(error_, position, alpha);
    residuals[0] = at.residual;
    const double softened = Soften(residuals)(0);
    const ByPosition by_position = softened * at.by_position;
    const double by_log_alpha = softened * at.by_log_alpha;
    ChainRule(point_, &by_position, &by_log_alpha, jacobians);
    return true;
  }

 private:
  const int point_;
  const InverseDepthError error_;
};

class InverseDepthTerm : public Term {
 public:
  explicit InverseDepthTerm(const InverseDepthOptions& options)
      : loss_{Loss::Kind::kHuber, options.huber_width}, weight_(options.weight / options.frames) {}

  std::unique_ptr<const Visit> Begin(const Views& views, const Footage&, const Visibility& visibility,
                                     int) const override {
    if (visibility.depths.empty()) return nullptr;
    return std::make_unique<InverseDepthVisit>(visibility, loss_, weight_,
                                               std::exp(views.variables().log_alpha));
  }

  void AddBlocks(const Visibility& visibility, BlockProblem* problem) const override {
    if (visibility.depths.empty()) return;
    for (int j = 0; j < problem->state().objective().prior().point_count; ++j) {
      for (const SeenDepth* seen = visibility.depths.begin(j); seen != visibility.depths.end(j); ++seen) {
        problem->Add(std::make_unique<InverseDepthBlock>(problem->state(), *seen, loss_.width, j),
                     problem->Scaled(weight_ * seen->weight, loss_));
      }
    }
  }

 private:
  const Loss loss_;
  const double weight_;
};

}  // namespace

std::unique_ptr<const Term> MakeInverseDepthTerm(const InverseDepthOptions& options) {
  return std::make_unique<InverseDepthTerm>(options);
}

}  // namespace spba
