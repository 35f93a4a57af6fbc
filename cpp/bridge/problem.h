// The core as Rust sees it: flat arrays in, flat arrays out. See src/bridge/ceres.rs for shapes and
// conventions.
#ifndef SPBA_BRIDGE_PROBLEM_H_
#define SPBA_BRIDGE_PROBLEM_H_

#include <memory>

#include "core/minimise.h"
#include "rust/cxx.h"

namespace spba {
namespace bridge {

struct FrameFootage;
struct Terms;
struct VisibilityInput;
struct Variables;
struct Costs;
struct Derivatives;
struct MinimiseOptions;
struct Summary;
struct PriorCallback;
struct Observer;

// Every function throws std::invalid_argument where sizes or indices do not fit, and std::runtime_error where
// the objective has no value; the bridge turns both into errors.

// Owns the images that the core borrows.
class Footage {
 public:
  explicit Footage(rust::Vec<FrameFootage> frames);
  ~Footage();

  const spba::Footage& core() const { return core_; }
  // Columns of a frame's mask.
  uint32_t silhouette_width(size_t frame) const;

 private:
  rust::Vec<FrameFootage> frames_;
  spba::Footage core_;
};

std::shared_ptr<Footage> new_footage(rust::Vec<FrameFootage> frames);

class Visibility {
 public:
  explicit Visibility(spba::Visibility core) : core_(std::move(core)) {}
  const spba::Visibility& core() const { return core_; }

 private:
  spba::Visibility core_;
};

class Problem {
 public:
  Problem(std::shared_ptr<Footage> footage, rust::Box<PriorCallback> prior, const Terms& terms);

  Costs evaluate(const Variables& variables, const Visibility& visibility, uint32_t threads);
  Derivatives differentiate(const Variables& variables, const Visibility& visibility, uint32_t threads);
  Summary minimise(Variables& variables, const Visibility& visibility, const MinimiseOptions& options,
                   Observer& observer);

  const Objective& objective() const { return objective_; }

 private:
  Evaluation Evaluate(const Variables& variables, const Visibility& visibility, Want want, uint32_t threads);
  spba::Variables ToCore(const Variables& variables) const;

  std::shared_ptr<Footage> footage_;
  Objective objective_;

  ShapeMemory memory_;
};

std::unique_ptr<Problem> new_problem(std::shared_ptr<Footage> footage, rust::Box<PriorCallback> prior,
                                     const Terms& terms);

std::unique_ptr<Visibility> new_visibility(const Problem& problem, const VisibilityInput& input);

}  // namespace bridge
}  // namespace spba

#endif  // SPBA_BRIDGE_PROBLEM_H_
