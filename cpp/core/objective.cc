#include "core/objective.h"

#include <algorithm>
#include <cmath>

#include "core/parallel.h"

namespace spba {
namespace {

// Points are summed in so many parts, whatever the number of threads; each part takes every kParts-th block
// of kBlock points, as the first points have more residuals than the last.
constexpr int kParts = 16, kBlock = 32;

}  // namespace

double Evaluation::Cost() const {
  double sum = 0.0;
  for (const double cost : equations.costs) sum += cost;
  return sum;
}

Evaluation Objective::Evaluate(const Variables& variables, const Visibility& visibility, Want want,
                               int threads, ShapeMemory* memory) const {
  const Layout layout{static_cast<int>(variables.camera_from_object.size()),
                      static_cast<int>(variables.style.size())};
  Evaluation evaluation{"", NormalEquations(layout, want)};
  try {
    const Views views(variables, prior_, weak_perspective_, want.derivatives() && want.style, memory);
    if (!views.InFront()) {
      evaluation.failure = kBehindCamera;
      return evaluation;
    }
    std::vector<std::unique_ptr<const Visit>> visits;
    for (const auto& term : terms_) {
      if (auto visit = term->Begin(views, *footage_, visibility, threads)) visits.push_back(std::move(visit));
    }
    const int points = visits.empty() ? 0 : views.point_count();
    const auto sum_part = [&](int part, NormalEquations* sums) {
      PointSystem system(views, *footage_, visibility.level, want);
      for (int block = kBlock * part; block < points; block += kBlock * kParts) {
        for (int j = block; j < std::min(points, block + kBlock); ++j) {
          system.Begin(j);
          for (const auto& visit : visits) visit->AddPoint(j, &system);
          system.Finish(sums);
        }
      }
      system.Flush(sums);
    };
    if (threads <= 1) {
      NormalEquations sums(layout, want);
      for (int part = 0; part < kParts; ++part) {
        if (part > 0) sums.SetZero();
        sum_part(part, &sums);
        evaluation.equations.Add(sums);
      }
    } else {
      std::vector<NormalEquations> sums(kParts, NormalEquations(layout, want));
      ParallelFor(kParts, threads, [&](int part) { sum_part(part, &sums[static_cast<size_t>(part)]); });
      for (const NormalEquations& part : sums) evaluation.equations.Add(part);
    }
    for (const auto& term : terms_) term->AddWhole(variables, layout, want, &evaluation.equations);
    evaluation.equations.Symmetrise();
    if (!std::isfinite(evaluation.Cost())) evaluation.failure = "the objective is not finite";
  } catch (const std::exception& error) {
    evaluation.failure = error.what();
  }
  return evaluation;
}

}  // namespace spba
