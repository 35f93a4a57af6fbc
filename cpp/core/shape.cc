#include "core/shape.h"

namespace spba {

const std::vector<double>& ShapeMemory::Points(const Prior& prior, const std::vector<double>& style) {
  if (!points_.known || points_.style != style) {
    points_.known = false;
    points_.values.resize(3 * static_cast<size_t>(prior.point_count));
    prior.points(style, &points_.values);
    points_.style = style;
    points_.known = true;
  }
  return points_.values;
}

const double* ShapeMemory::Jacobian(const Prior& prior, const std::vector<double>& style) {
  if (prior.constant_jacobian != nullptr) return prior.constant_jacobian;
  if (!jacobian_.known || jacobian_.style != style) {
    jacobian_.known = false;
    jacobian_.values.resize(3 * static_cast<size_t>(prior.point_count) *
                            static_cast<size_t>(prior.style_count));
    prior.jacobian(style, &jacobian_.values);
    jacobian_.style = style;
    jacobian_.known = true;
  }
  return jacobian_.values.data();
}

}  // namespace spba
