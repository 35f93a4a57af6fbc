#include "core/system.h"

#include <ceres/jet.h>

#include <Eigen/Geometry>

#include "spba/photometric.h"

namespace spba {
namespace {

// a^T times the derivative of a position by the camera's twist; `turned` = R x. Inline, as it has little to
// do.
inline Vector6 ByTwist(const TwistScales& scales, const Vector3& turned, double a0, double a1, double a2) {
  const double v0 = turned[0], v1 = turned[1], v2 = turned[2];
  const double u0 = scales.turn[0] * a0, u1 = scales.turn[1] * a1, u2 = scales.turn[2] * a2;
  Vector6 product;
  product << v1 * u2 - v2 * u1, v2 * u0 - v0 * u2, v0 * u1 - v1 * u0, scales.translation[0] * a0,
      scales.translation[1] * a1, scales.translation[2] * a2;
  return product;
}
inline Vector6 ByTwist(const TwistScales& scales, const Vector3& turned, const Vector3& a) {
  return ByTwist(scales, turned, a[0], a[1], a[2]);
}

// The block of two cameras' twists += what a curvature between the positions is there: only cross products
// are left of a^T C b.
void AddTwists(const TwistScales& scales, const Vector3& turned_a, const Vector3& turned_b,
               const Matrix3& curvature, int a, int b, RowMajorMatrix* matrix) {
  Vector6 rows[3];  // of C b
  for (int r = 0; r < 3; ++r) {
    rows[r] = ByTwist(scales, turned_b, curvature(r, 0), curvature(r, 1), curvature(r, 2));
  }
  double* const target = &(*matrix)(a, b);
  const Eigen::Index stride = matrix->cols();
  for (int c = 0; c < 6; ++c) {
    const Vector6 column = ByTwist(scales, turned_a, rows[0][c], rows[1][c], rows[2][c]);
    for (int r = 0; r < 6; ++r) target[r * stride + c] += column[r];
  }
}

}  // namespace

NormalEquations::NormalEquations(const Layout& layout, Want want) {
  if (want.derivatives()) gradient.setZero(layout.size());
  if (want.normal_matrix()) matrix.setZero(layout.size(), layout.size());
}

void NormalEquations::Add(const NormalEquations& other) {
  for (int i = 0; i < kTerms; ++i) costs[i] += other.costs[i];
  gradient += other.gradient;
  matrix += other.matrix;
}

void NormalEquations::SetZero() {
  costs.fill(0.0);
  gradient.setZero();
  matrix.setZero();
}

void NormalEquations::Symmetrise() { matrix.triangularView<Eigen::StrictlyLower>() = matrix.transpose(); }

PointSystem::PointSystem(const Views& views, const Footage& footage, int level, Want want)
    : views_(views),
      footage_(footage),
      level_(level),
      want_(want),
      scales_(views),
      slots_(static_cast<size_t>(views.frame_count()), -1) {
  seen_.reserve(slots_.size());
  dense_styles_ = views.style_count();
  for (const AxisStyles& styles : views.axis_styles()) dense_styles_ -= styles.count;
  int begin = dense_styles_;
  for (const AxisStyles& styles : views.axis_styles()) {
    runs_.push_back({styles.axis, begin, begin + styles.count});
    begin += styles.count;
  }
  if (want.normal_matrix() && want.style) {
    batch_x_.setZero(3 * kBatch, views.style_count());
    batch_vx_.setZero(3 * kBatch, views.style_count());
  }
}

void PointSystem::Begin(int j) {
  for (const PointView& view : seen_) slots_[static_cast<size_t>(view.frame)] = -1;
  seen_.clear();
  pairs_.clear();
  alpha_gradient_ = alpha_curvature_ = 0.0;
  point_ = j;
}

int PointSystem::Slot(int l) {
  int& slot = slots_[static_cast<size_t>(l)];
  if (slot < 0) {
    slot = static_cast<int>(seen_.size());
    PointView& view = seen_.emplace_back();
    view.frame = l;
    view.position = views_.InCamera(l, point_);
    view.has_colour = false;
    view.gradient.setZero();
    view.curvature.setZero();
    view.by_colour = 0.0;
    view.with_alpha.setZero();
  }
  return slot;
}

PointView& PointSystem::View(int l) { return seen_[static_cast<size_t>(Slot(l))]; }

PointView& PointSystem::ColouredView(int l) {
  PointView& view = View(l);
  if (view.has_colour) return view;
  view.has_colour = true;
  const LevelImage& image = *footage_.frames[static_cast<size_t>(l)].levels[static_cast<size_t>(level_)];
  const PointColour colour{image.camera, &image.sampler};
  if (!want_.derivatives()) {
    view.colour.setConstant(kNotEvaluated);
    colour(view.position.data(), view.colour.data());
    return view;
  }
  using Jet = ceres::Jet<double, 3>;
  const Jet position[3] = {Jet(view.position[0], 0), Jet(view.position[1], 1), Jet(view.position[2], 2)};
  Jet rgb[3] = {Jet(kNotEvaluated), Jet(kNotEvaluated), Jet(kNotEvaluated)};
  colour(position, rgb);
  for (int c = 0; c < 3; ++c) {
    view.colour[c] = rgb[c].a;
    view.colour_by_position.row(c) = rgb[c].v.transpose();
  }
  return view;
}

void PointSystem::AddWithAlpha(PointView* view, const Weighed<1>& weighed, double residual,
                               const Eigen::Matrix<double, 1, 3>& by_position, double by_log_alpha) {
  Add<1>(view, weighed, Eigen::Matrix<double, 1, 1>(residual), by_position);
  alpha_gradient_ += by_log_alpha * weighed.slope[0];
  const double curvature = weighed.across * (1.0 - weighed.less_along * residual * residual);
  alpha_curvature_ += curvature * by_log_alpha * by_log_alpha;
  view->with_alpha += curvature * by_log_alpha * by_position.transpose();
}

void PointSystem::AddDifference(PointView* a, PointView* b, const Weighed<3>& weighed,
                                const Vector3& residual) {
  const Matrix3& by_a = a->colour_by_position;
  const Matrix3& by_b = b->colour_by_position;
  a->gradient.noalias() += by_a.transpose() * weighed.slope;
  b->gradient.noalias() -= by_b.transpose() * weighed.slope;
  if (!want_.normal_matrix()) return;
  PairBlock& pair = pairs_.emplace_back();
  pair.a = slots_[static_cast<size_t>(a->frame)];
  pair.b = slots_[static_cast<size_t>(b->frame)];
  pair.curvature.setZero();
  a->by_colour += weighed.across;
  b->by_colour += weighed.across;
  AddProduct(-weighed.across, by_a, by_b, &pair.curvature);
  if (weighed.less_along != 0.0) {
    using Row3 = Eigen::Matrix<double, 1, 3>;
    const double less = weighed.across * weighed.less_along;
    const Row3 along_a = residual.transpose() * by_a, along_b = residual.transpose() * by_b;
    AddProduct(-less, along_a, along_a, &a->curvature);
    AddProduct(-less, along_b, along_b, &b->curvature);
    AddProduct(less, along_a, along_b, &pair.curvature);
  }
}

void PointSystem::Finish(NormalEquations* sums) {
  for (int i = 0; i < kTerms; ++i) sums->costs[i] += costs_[i];
  costs_.fill(0.0);
  if (!want_.derivatives() || seen_.empty()) return;
  const Layout& layout = views_.layout();
  const int styles = layout.styles;
  const double* const x = want_.style ? views_.PointJacobian(point_) : nullptr;
  double* const gradient = sums->gradient.data();

  Vector3 by_point = Vector3::Zero();
  turned_.resize(seen_.size());
  for (size_t i = 0; i < seen_.size(); ++i) {
    const PointView& view = seen_[i];
    turned_[i] = views_.Turned(view.frame, point_);
    by_point.noalias() += views_.frame(view.frame).linear.transpose() * view.gradient;
    Eigen::Map<Vector6>(gradient + layout.pose(view.frame)) += ByTwist(scales_, turned_[i], view.gradient);
    if (want_.focal) gradient[layout.log_focal()] += Views::ByLogFocal(view.position).dot(view.gradient);
  }
  if (want_.style) AddRow(by_point, x, gradient + layout.style(), 1);
  gradient[layout.log_alpha()] += alpha_gradient_;
  if (!want_.normal_matrix()) return;

  RowMajorMatrix& matrix = sums->matrix;
  by_style_.resize(seen_.size());
  with_focal_by_position_.resize(seen_.size());
  for (size_t i = 0; i < seen_.size(); ++i) {
    PointView& view = seen_[i];
    if (view.by_colour != 0.0) {
      AddProduct(view.by_colour, view.colour_by_position, view.colour_by_position, &view.curvature);
    }
    by_style_[i].noalias() = view.curvature * views_.frame(view.frame).linear;
    if (want_.focal) {
      with_focal_by_position_[i].noalias() = view.curvature * Views::ByLogFocal(view.position);
    }
    const int at = layout.pose(view.frame);
    AddTwists(scales_, turned_[i], turned_[i], view.curvature, at, at, &matrix);
  }
  for (const PairBlock& pair : pairs_) {
    const auto a = static_cast<size_t>(pair.a), b = static_cast<size_t>(pair.b);
    const PointView &view_a = seen_[a], &view_b = seen_[b];
    const Matrix3 turned_over = pair.curvature.transpose();
    by_style_[a].noalias() += pair.curvature * views_.frame(view_b.frame).linear;
    by_style_[b].noalias() += turned_over * views_.frame(view_a.frame).linear;
    if (want_.focal) {
      with_focal_by_position_[a].noalias() += pair.curvature * Views::ByLogFocal(view_b.position);
      with_focal_by_position_[b].noalias() += turned_over * Views::ByLogFocal(view_a.position);
    }
    const int at_a = layout.pose(view_a.frame), at_b = layout.pose(view_b.frame);
    if (view_a.frame < view_b.frame) {
      AddTwists(scales_, turned_[a], turned_[b], pair.curvature, at_a, at_b, &matrix);
    } else {
      AddTwists(scales_, turned_[b], turned_[a], turned_over, at_b, at_a, &matrix);
    }
  }

  Matrix3 by_point_twice = Matrix3::Zero();
  Vector3 alpha_by_point = Vector3::Zero(), focal_by_point = Vector3::Zero();
  for (size_t i = 0; i < seen_.size(); ++i) {
    const PointView& view = seen_[i];
    const Matrix3& linear = views_.frame(view.frame).linear;
    const int at = layout.pose(view.frame);
    by_point_twice.noalias() += linear.transpose() * by_style_[i];
    if (want_.style) {
      Matrix36 with_point;
      for (int c = 0; c < 3; ++c) {
        with_point.row(c) = ByTwist(scales_, turned_[i], by_style_[i].col(c)).transpose();
      }
      AddRows(with_point, x, &matrix(at, layout.style()), layout.size());
    }
    matrix.block<6, 1>(at, layout.log_alpha()) += ByTwist(scales_, turned_[i], view.with_alpha);
    alpha_by_point.noalias() += linear.transpose() * view.with_alpha;
    if (want_.focal) {
      const Vector3 by_focal = Views::ByLogFocal(view.position);
      matrix.block<6, 1>(at, layout.log_focal()) += ByTwist(scales_, turned_[i], with_focal_by_position_[i]);
      focal_by_point.noalias() += linear.transpose() * with_focal_by_position_[i];
      matrix(layout.log_focal(), layout.log_focal()) += by_focal.dot(with_focal_by_position_[i]);
      matrix(layout.log_alpha(), layout.log_focal()) += by_focal.dot(view.with_alpha);
    }
  }
  matrix(layout.log_alpha(), layout.log_alpha()) += alpha_curvature_;
  if (!want_.style) return;
  AddRow(alpha_by_point, x, &matrix(layout.style(), layout.log_alpha()), layout.size());
  if (want_.focal) AddRow(focal_by_point, x, &matrix(layout.style(), layout.log_focal()), layout.size());

  for (int r = 0; r < 3; ++r) {
    const Eigen::Index at = r * kBatch + batched_;
    const auto row = [&](int axis) {
      return Eigen::Map<const Eigen::RowVectorXd>(x + axis * styles, styles);
    };
    batch_x_.row(at) = row(r);
    const Vector3 v = by_point_twice.row(r);
    batch_vx_.row(at).head(dense_styles_) = v[0] * row(0).head(dense_styles_) +
                                            v[1] * row(1).head(dense_styles_) +
                                            v[2] * row(2).head(dense_styles_);
    for (const StyleRun& run : runs_) {
      batch_vx_.row(at).segment(run.begin, run.count()) =
          v[run.axis] * row(run.axis).segment(run.begin, run.count());
    }
  }
  if (++batched_ == kBatch) FlushStyles(sums);
}

void PointSystem::AddRow(const Vector3& a, const double* x, double* target, Eigen::Index stride) const {
  const int styles = views_.style_count();
  const double *x0 = x, *x1 = x + styles, *x2 = x + 2 * styles;
  for (int c = 0; c < dense_styles_; ++c) target[c * stride] += a[0] * x0[c] + a[1] * x1[c] + a[2] * x2[c];
  for (const StyleRun& run : runs_) {
    const double factor = a[run.axis], *x_axis = x + run.axis * styles;
    for (int c = run.begin; c < run.end; ++c) target[c * stride] += factor * x_axis[c];
  }
}

void PointSystem::AddRows(const Matrix36& a, const double* x, double* target, Eigen::Index stride) const {
  const int styles = views_.style_count();
  const double *x0 = x, *x1 = x + styles, *x2 = x + 2 * styles;
  // Two rows at a time share what is loaded of X.
  for (int r = 0; r < 6; r += 2) {
    double* __restrict const even = target + r * stride, * __restrict const odd = even + stride;
    const double e0 = a(0, r), e1 = a(1, r), e2 = a(2, r);
    const double o0 = a(0, r + 1), o1 = a(1, r + 1), o2 = a(2, r + 1);
    for (int c = 0; c < dense_styles_; ++c) {
      even[c] += e0 * x0[c] + e1 * x1[c] + e2 * x2[c];
      odd[c] += o0 * x0[c] + o1 * x1[c] + o2 * x2[c];
    }
    for (const StyleRun& run : runs_) {
      const double e = a(run.axis, r), o = a(run.axis, r + 1), *x_axis = x + run.axis * styles;
      for (int c = run.begin; c < run.end; ++c) {
        even[c] += e * x_axis[c];
        odd[c] += o * x_axis[c];
      }
    }
  }
}

void PointSystem::FlushStyles(NormalEquations* sums) {
  const Layout& layout = views_.layout();
  for (int r = 0; r < 3; ++r) batch_vx_.middleRows(r * kBatch + batched_, kBatch - batched_).setZero();
  batched_ = 0;
  auto by_styles = sums->matrix.block(layout.style(), layout.style(), layout.styles, layout.styles);
  if (dense_styles_ > 0)
    by_styles.topLeftCorner(dense_styles_, dense_styles_).triangularView<Eigen::Upper>() +=
        batch_x_.leftCols(dense_styles_).transpose() * batch_vx_.leftCols(dense_styles_);
  for (const StyleRun& run : runs_) {
    // As V is symmetric, X^T (V x) = (V X)^T x.
    by_styles.block(0, run.begin, dense_styles_, run.count()).noalias() +=
        batch_vx_.block(run.axis * kBatch, 0, kBatch, dense_styles_).transpose() *
        batch_x_.block(run.axis * kBatch, run.begin, kBatch, run.count());
    const int rest = layout.styles - run.begin;
    by_styles.block(run.begin, run.begin, run.count(), rest).noalias() +=
        batch_x_.block(run.axis * kBatch, run.begin, kBatch, run.count()).transpose() *
        batch_vx_.block(run.axis * kBatch, run.begin, kBatch, rest);
  }
}

void PointSystem::Flush(NormalEquations* sums) {
  if (batched_ > 0) FlushStyles(sums);
}

}  // namespace spba
