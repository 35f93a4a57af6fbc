#include "core/system.h"

#include <ceres/jet.h>

#include "spba/photometric.h"

namespace spba {
namespace {

// target row (1 x S) += a^T X for a 3-vector a and X = dx/ds.
void AddRow(const Vector3& a, const double* x, int styles, double* __restrict target) {
  const double *x0 = x, *x1 = x + styles, *x2 = x + 2 * styles;
  const double a0 = a[0], a1 = a[1], a2 = a[2];
  for (int c = 0; c < styles; ++c) target[c] += a0 * x0[c] + a1 * x1[c] + a2 * x2[c];
}

// The 6 x 6 block of `matrix` at (row, column) += a^T b.
void AddProduct(const Matrix36& a, const Matrix36& b, int row, int column, RowMajorMatrix* matrix) {
  for (int r = 0; r < 6; ++r) {
    double* __restrict const target = &(*matrix)(row + r, column);
    const double a0 = a(0, r), a1 = a(1, r), a2 = a(2, r);
    for (int c = 0; c < 6; ++c) target[c] += a0 * b(0, c) + a1 * b(1, c) + a2 * b(2, c);
  }
}

// A small product without a temporary or a call.
Matrix36 Times(const Matrix3& a, const Matrix36& b) {
  Matrix36 product;
  for (int r = 0; r < 3; ++r) {
    const double a0 = a(r, 0), a1 = a(r, 1), a2 = a(r, 2);
    for (int c = 0; c < 6; ++c) product(r, c) = a0 * b(0, c) + a1 * b(1, c) + a2 * b(2, c);
  }
  return product;
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
      slots_(static_cast<size_t>(views.frame_count()), -1) {
  seen_.reserve(slots_.size());
  if (want.normal_matrix() && want.style) {
    batch_x_.resize(3 * kBatch, views.style_count());
    batch_vx_.resize(3 * kBatch, views.style_count());
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
  a->curvature.noalias() += weighed.across * (by_a.transpose() * by_a);
  b->curvature.noalias() += weighed.across * (by_b.transpose() * by_b);
  pair.curvature.noalias() = -weighed.across * (by_a.transpose() * by_b);
  if (weighed.less_along != 0.0) {
    const double less = weighed.across * weighed.less_along;
    const Vector3 along_a = by_a.transpose() * residual, along_b = by_b.transpose() * residual;
    a->curvature.noalias() -= less * (along_a * along_a.transpose());
    b->curvature.noalias() -= less * (along_b * along_b.transpose());
    pair.curvature.noalias() += less * (along_a * along_b.transpose());
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
  by_pose_.resize(seen_.size());
  for (size_t i = 0; i < seen_.size(); ++i) {
    const PointView& view = seen_[i];
    by_pose_[i] = views_.ByPose(view.frame, point_);
    by_point.noalias() += views_.frame(view.frame).linear.transpose() * view.gradient;
    Eigen::Map<Vector6>(gradient + layout.pose(view.frame)).noalias() +=
        by_pose_[i].transpose() * view.gradient;
    if (want_.focal) gradient[layout.log_focal()] += Views::ByLogFocal(view.position).dot(view.gradient);
  }
  if (want_.style) AddRow(by_point, x, styles, gradient + layout.style());
  gradient[layout.log_alpha()] += alpha_gradient_;
  if (!want_.normal_matrix()) return;

  RowMajorMatrix& matrix = sums->matrix;
  by_style_.resize(seen_.size());
  with_focal_by_position_.resize(seen_.size());
  for (size_t i = 0; i < seen_.size(); ++i) {
    const PointView& view = seen_[i];
    by_style_[i].noalias() = view.curvature * views_.frame(view.frame).linear;
    if (want_.focal) {
      with_focal_by_position_[i].noalias() = view.curvature * Views::ByLogFocal(view.position);
    }
    const Matrix36 curved = Times(view.curvature, by_pose_[i]);
    const int at = layout.pose(view.frame);
    AddProduct(by_pose_[i], curved, at, at, &matrix);
  }
  for (const PairBlock& pair : pairs_) {
    const auto a = static_cast<size_t>(pair.a), b = static_cast<size_t>(pair.b);
    const PointView &view_a = seen_[a], &view_b = seen_[b];
    by_style_[a].noalias() += pair.curvature * views_.frame(view_b.frame).linear;
    by_style_[b].noalias() += pair.curvature.transpose() * views_.frame(view_a.frame).linear;
    if (want_.focal) {
      with_focal_by_position_[a].noalias() += pair.curvature * Views::ByLogFocal(view_b.position);
      with_focal_by_position_[b].noalias() += pair.curvature.transpose() * Views::ByLogFocal(view_a.position);
    }
    if (view_a.frame < view_b.frame) {
      const Matrix36 curved = Times(pair.curvature, by_pose_[b]);
      AddProduct(by_pose_[a], curved, layout.pose(view_a.frame), layout.pose(view_b.frame), &matrix);
    } else {
      const Matrix36 curved = Times(pair.curvature.transpose(), by_pose_[a]);
      AddProduct(by_pose_[b], curved, layout.pose(view_b.frame), layout.pose(view_a.frame), &matrix);
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
      const Eigen::Matrix<double, 6, 3> with_point = by_pose_[i].transpose() * by_style_[i];
      for (int r = 0; r < 6; ++r) {
        AddRow(with_point.row(r), x, styles, &matrix(at + r, layout.style()));
      }
    }
    matrix.block<6, 1>(at, layout.log_alpha()).noalias() += by_pose_[i].transpose() * view.with_alpha;
    alpha_by_point.noalias() += linear.transpose() * view.with_alpha;
    if (want_.focal) {
      const Vector3 by_focal = Views::ByLogFocal(view.position);
      matrix.block<6, 1>(at, layout.log_focal()).noalias() +=
          by_pose_[i].transpose() * with_focal_by_position_[i];
      focal_by_point.noalias() += linear.transpose() * with_focal_by_position_[i];
      matrix(layout.log_focal(), layout.log_focal()) += by_focal.dot(with_focal_by_position_[i]);
      matrix(layout.log_alpha(), layout.log_focal()) += by_focal.dot(view.with_alpha);
    }
  }
  matrix(layout.log_alpha(), layout.log_alpha()) += alpha_curvature_;
  if (!want_.style) return;
  for (int k = 0; k < styles; ++k) {
    const Vector3 column(x[k], x[styles + k], x[2 * styles + k]);
    matrix(layout.style() + k, layout.log_alpha()) += column.dot(alpha_by_point);
    if (want_.focal) matrix(layout.style() + k, layout.log_focal()) += column.dot(focal_by_point);
  }

  const Eigen::Map<const RowMajorMatrix> x_matrix(x, 3, styles);
  batch_x_.middleRows<3>(3 * batched_) = x_matrix;
  batch_vx_.middleRows<3>(3 * batched_).noalias() = by_point_twice * x_matrix;
  if (++batched_ == kBatch) FlushStyles(sums);
}

void PointSystem::FlushStyles(NormalEquations* sums) {
  const Layout& layout = views_.layout();
  sums->matrix.block(layout.style(), layout.style(), layout.styles, layout.styles)
      .triangularView<Eigen::Upper>() +=
      batch_x_.topRows(3 * batched_).transpose() * batch_vx_.topRows(3 * batched_);
  batched_ = 0;
}

void PointSystem::Flush(NormalEquations* sums) {
  if (batched_ > 0) FlushStyles(sums);
}

}  // namespace spba
