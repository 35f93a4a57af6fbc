#include "core/terms/photometric.h"

#include "core/blocks.h"
#include "spba/photometric.h"

namespace spba {
namespace {

class PhotometricVisit : public Visit {
 public:
  PhotometricVisit(const Visibility& visibility, const Loss& loss, double weight)
      : visibility_(visibility), loss_(loss), weight_(weight) {}

  void AddPoint(int j, PointSystem* system) const override {
    for (const Comparison* item = visibility_.comparisons.begin(j); item != visibility_.comparisons.end(j);
         ++item) {
      const Visibility::Pair& pair = visibility_.pairs[item->pair];
      PointView& a = system->ColouredView(static_cast<int>(pair.a));
      PointView& b = system->ColouredView(static_cast<int>(pair.b));
      const Vector3 residual = a.colour - b.colour;
      const Weighed<3> weighed(loss_, weight_ * pair.weight * item->directions, residual);
      system->costs()[kPhotometric] += weighed.cost;
      if (system->with_derivatives()) system->AddDifference(&a, &b, weighed, residual);
    }
  }

 private:
  const Visibility& visibility_;
  const Loss& loss_;
  const double weight_;
};

// One point and one pair.
class PhotometricBlock : public Block<3> {
 public:
  PhotometricBlock(const BlockState& state, const Visibility::Pair& pair, double width, int point,
                   const PhotometricError& error)
      : Block(state, {static_cast<int>(pair.a), static_cast<int>(pair.b)}, width, false),
        point_(point),
        error_(error) {}

  bool Evaluate(double const* const*, double* residuals, double** jacobians) const override {
    if (!state_.usable()) return false;
    const Vector3 in_a = InCamera(0, point_), in_b = InCamera(1, point_);
    if (jacobians == nullptr) {
      if (!error_(in_a.data(), in_b.data(), residuals)) return false;
      Soften(residuals);
      return true;
    }
    using Jet = ceres::Jet<double, 6>;
    Jet a[3], b[3], outputs[3];
    for (int i = 0; i < 3; ++i) {
      a[i] = Jet(in_a[i], i);
      b[i] = Jet(in_b[i], 3 + i);
    }
    if (!error_(a, b, outputs)) return false;
    ByPosition by_position[2];
    for (int r = 0; r < 3; ++r) {
      residuals[r] = outputs[r].a;
      by_position[0].row(r) = outputs[r].v.head<3>().transpose();
      by_position[1].row(r) = outputs[r].v.tail<3>().transpose();
    }
    const auto softened = Soften(residuals);
    for (ByPosition& by : by_position) by = softened * by;
    ChainRule(point_, by_position, nullptr, jacobians);
    return true;
  }

 private:
  const int point_;
  const PhotometricError error_;
};

class PhotometricTerm : public Term {
 public:
  explicit PhotometricTerm(const PhotometricOptions& options)
      : loss_{Loss::Kind::kHuber, options.huber_width}, weight_(options.weight) {}

  std::unique_ptr<const Visit> Begin(const Views&, const Footage&, const Visibility& visibility,
                                     int) const override {
    if (visibility.comparisons.empty()) return nullptr;
    return std::make_unique<PhotometricVisit>(visibility, loss_, weight_);
  }

  void AddBlocks(const Visibility& visibility, BlockProblem* problem) const override {
    if (visibility.comparisons.empty()) return;
    const Footage& footage = problem->state().objective().footage();
    const auto level = static_cast<size_t>(visibility.level);
    for (int j = 0; j < problem->state().objective().prior().point_count; ++j) {
      for (const Comparison* item = visibility.comparisons.begin(j); item != visibility.comparisons.end(j);
           ++item) {
        const Visibility::Pair& pair = visibility.pairs[item->pair];
        const LevelImage& a = *footage.frames[pair.a].levels[level];
        const LevelImage& b = *footage.frames[pair.b].levels[level];
        problem->Add(
            std::make_unique<PhotometricBlock>(problem->state(), pair, loss_.width, j,
                                               PhotometricError{a.camera, b.camera, &a.sampler, &b.sampler}),
            problem->Scaled(weight_ * pair.weight * item->directions, loss_));
      }
    }
  }

 private:
  const Loss loss_;
  const double weight_;
};

}  // namespace

std::unique_ptr<const Term> MakePhotometricTerm(const PhotometricOptions& options) {
  return std::make_unique<PhotometricTerm>(options);
}

}  // namespace spba
