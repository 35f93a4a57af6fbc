// The shape as the core sees it: X(s) and its derivative, and a memory of the last style's.
#ifndef SPBA_CORE_SHAPE_H_
#define SPBA_CORE_SHAPE_H_

#include <functional>
#include <vector>

#include "core/geometry.h"

namespace spba {

// Styles, one after another, that each move every point along one axis of the object alone.
struct AxisStyles {
  int axis, count;
};

// X = G(s) for a prefix of the prior's points, row-major 3N and 3N x S. The functions throw where the prior
// fails.
struct Prior {
  int point_count = 0, style_count = 0;
  // The derivative where it is the same at every style; `jacobian` is not called then. Lives as long as
  // `points`.
  const double* constant_jacobian = nullptr;
  // What the last styles are, where they are such: the derivative's rows across their axes are zero, and are
  // not looked at.
  std::vector<AxisStyles> axis_styles;
  std::function<void(const std::vector<double>& style, std::vector<double>* points)> points;
  std::function<void(const std::vector<double>& style, std::vector<double>* jacobian)> jacobian;
};

// X and dX/ds at the last style asked for. One a thread of evaluations; holds nothing that the style does not
// decide.
class ShapeMemory {
 public:
  // 3N entries; throws where the prior fails, and forgets the style then.
  const std::vector<double>& Points(const Prior& prior, const std::vector<double>& style);
  // 3N x S entries.
  const double* Jacobian(const Prior& prior, const std::vector<double>& style);

 private:
  struct Kept {
    bool known = false;
    std::vector<double> style, values;
  };
  Kept points_, jacobian_;
};

}  // namespace spba

#endif  // SPBA_CORE_SHAPE_H_
