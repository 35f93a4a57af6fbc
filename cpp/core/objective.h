// Eq. 9 and its one evaluation.
#ifndef SPBA_CORE_OBJECTIVE_H_
#define SPBA_CORE_OBJECTIVE_H_

#include <memory>
#include <string>
#include <vector>

#include "core/term.h"

namespace spba {

constexpr char kBehindCamera[] = "a point of the shape lies behind a camera";

// What Evaluate found. Without a value where `failure` says why: the prior failed, or a point lies behind a
// camera.
struct Evaluation {
  std::string failure;
  NormalEquations equations;

  bool ok() const { return failure.empty(); }
  double Cost() const;
};

// Evaluations that a minimiser asked for.
struct Counts {
  int residual = 0, jacobian = 0;
};

class Objective {
 public:
  Objective(std::shared_ptr<const Footage> footage, Prior prior, bool weak_perspective)
      : footage_(std::move(footage)), prior_(std::move(prior)), weak_perspective_(weak_perspective) {}

  void Add(std::unique_ptr<const Term> term) { terms_.push_back(std::move(term)); }

  // The cost by term, and as much of its derivatives as is wanted, at `variables`. The bytes do not depend on
  // `threads`. What an earlier evaluation did has no influence.
  Evaluation Evaluate(const Variables& variables, const Visibility& visibility, Want want, int threads,
                      ShapeMemory* memory) const;

  const Footage& footage() const { return *footage_; }
  const Prior& prior() const { return prior_; }
  bool weak_perspective() const { return weak_perspective_; }
  const std::vector<std::unique_ptr<const Term>>& terms() const { return terms_; }

 private:
  std::shared_ptr<const Footage> footage_;
  Prior prior_;
  bool weak_perspective_;
  std::vector<std::unique_ptr<const Term>> terms_;
};

}  // namespace spba

#endif  // SPBA_CORE_OBJECTIVE_H_
