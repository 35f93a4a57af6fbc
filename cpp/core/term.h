// What a term of the objective is. A term is one file: its data, weight, loss, how its residuals are found at
// a point of evaluation, and its residual blocks for Ceres.
#ifndef SPBA_CORE_TERM_H_
#define SPBA_CORE_TERM_H_

#include <memory>

#include "core/system.h"
#include "core/visibility.h"

namespace spba {

class BlockProblem;

// What a term finds at one point of evaluation.
class Visit {
 public:
  virtual ~Visit() = default;
  // Adds the residuals of point j; called for all points, on several threads.
  virtual void AddPoint(int j, PointSystem* system) const = 0;
};

class Term {
 public:
  virtual ~Term() = default;

  // Null where the term has no residuals of points. Borrows what it is given.
  virtual std::unique_ptr<const Visit> Begin(const Views& /*views*/, const Footage& /*footage*/,
                                             const Visibility& /*visibility*/, int /*threads*/) const {
    return nullptr;
  }
  // Adds the residuals that are of no point.
  virtual void AddWhole(const Variables& /*variables*/, const Layout& /*layout*/, Want /*want*/,
                        NormalEquations* /*sums*/) const {}
  // Adds the same residuals as blocks.
  virtual void AddBlocks(const Visibility& visibility, BlockProblem* problem) const = 0;
};

}  // namespace spba

#endif  // SPBA_CORE_TERM_H_
