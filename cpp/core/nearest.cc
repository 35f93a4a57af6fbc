#include "core/nearest.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace spba {

SilhouetteLookup::SilhouetteLookup(int width, int padding, int grid_width, int grid_height,
                                   std::vector<uint32_t> nearest, std::vector<uint32_t> boundary)
    : width_(width),
      padding_(padding),
      grid_width_(grid_width),
      grid_height_(grid_height),
      nearest_(std::move(nearest)),
      boundary_(std::move(boundary)) {}

Eigen::Vector2d SilhouetteLookup::Centre(uint32_t index) const {
  return {index % width_ + 0.5, index / width_ + 0.5};
}

Eigen::Vector2d SilhouetteLookup::Nearest(const Eigen::Vector2d& point, double near_enough) const {
  Eigen::Vector2d best = Eigen::Vector2d::Zero();
  double best_distance = std::numeric_limits<double>::infinity();
  const auto consider = [&](uint32_t index) {
    const Eigen::Vector2d centre = Centre(index);
    const double distance = (centre - point).squaredNorm();
    if (distance < best_distance) {
      best_distance = distance;
      best = centre;
    }
  };
  const double x = point.x() + padding_, y = point.y() + padding_;
  if (!(x >= 1 && y >= 1 && x < grid_width_ - 1 && y < grid_height_ - 1)) {
    for (const uint32_t index : boundary_) consider(index);
    return best;
  }
  const int column = static_cast<int>(x), row = static_cast<int>(y);
  consider(nearest_[static_cast<size_t>(row) * grid_width_ + column]);
  if (best_distance <= near_enough * near_enough) return best;
  // The nearest pixel of a cell's centre need not be that of every point in the cell; a neighbouring cell's
  // is.
  for (int r = row - 1; r <= row + 1; ++r) {
    for (int c = column - 1; c <= column + 1; ++c) {
      consider(nearest_[static_cast<size_t>(r) * grid_width_ + c]);
    }
  }
  return best;
}

PointGrid::PointGrid(const std::vector<Eigen::Vector2d>& points) {
  Eigen::Vector2d high = points.front();
  low_ = high;
  for (const Eigen::Vector2d& point : points) {
    low_ = low_.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  // About two points a cell; never finer than a pixel, never more cells than points ask for.
  const Eigen::Vector2d extent = (high - low_).cwiseMax(1.0);
  cell_size_ = std::max(1.0, std::sqrt(2.0 * extent.x() * extent.y() / static_cast<double>(points.size())));
  cell_size_ = std::max(cell_size_, extent.maxCoeff() / 4096.0);
  cells_per_pixel_ = 1.0 / cell_size_;
  columns_ = static_cast<int>(extent.x() * cells_per_pixel_) + 1;
  rows_ = static_cast<int>(extent.y() * cells_per_pixel_) + 1;

  std::vector<int> cells(points.size());
  first_.assign(static_cast<size_t>(columns_) * static_cast<size_t>(rows_) + 1, 0);
  for (size_t i = 0; i < points.size(); ++i) {
    cells[i] = Row(points[i].y()) * columns_ + Column(points[i].x());
    ++first_[static_cast<size_t>(cells[i]) + 1];
  }
  for (size_t c = 1; c < first_.size(); ++c) first_[c] += first_[c - 1];
  entries_.reset(new Entry[points.size()]);
  std::vector<int> next(first_.begin(), first_.end() - 1);
  for (size_t i = 0; i < points.size(); ++i) {
    entries_[static_cast<size_t>(next[static_cast<size_t>(cells[i])]++)] = {points[i].x(), points[i].y(),
                                                                            static_cast<int>(i)};
  }
}

int PointGrid::Column(double x) const {
  return static_cast<int>(std::clamp((x - low_.x()) * cells_per_pixel_, 0.0, columns_ - 1.0));
}

int PointGrid::Row(double y) const {
  return static_cast<int>(std::clamp((y - low_.y()) * cells_per_pixel_, 0.0, rows_ - 1.0));
}

int PointGrid::Nearest(const Eigen::Vector2d& pixel, double near_enough) const {
  const double enough = near_enough * near_enough;
  const int column = Column(pixel.x()), row = Row(pixel.y());
  // A pixel outside the grid is searched from its nearest cell; every cell of ring k is then at least
  // (k - 1) cells away from the pixel's foot on the grid, and so from the pixel.
  int best = -1;
  double best_distance = std::numeric_limits<double>::infinity();
  const int last_ring = std::max(columns_, rows_);
  for (int ring = 0; ring <= last_ring; ++ring) {
    const double reach = (ring - 1) * cell_size_;
    if (best >= 0 && ring > 0 && reach > 0 && reach * reach > best_distance) break;
    for (int r = row - ring; r <= row + ring; ++r) {
      if (r < 0 || r >= rows_) continue;
      const bool edge_row = r == row - ring || r == row + ring;
      const int step = edge_row ? 1 : std::max(1, 2 * ring);
      for (int c = column - ring; c <= column + ring; c += step) {
        if (c < 0 || c >= columns_) continue;
        const auto cell = static_cast<size_t>(r * columns_ + c);
        for (int k = first_[cell]; k < first_[cell + 1]; ++k) {
          const Entry& entry = entries_[static_cast<size_t>(k)];
          const double x = entry.x - pixel.x(), y = entry.y - pixel.y(), distance = x * x + y * y;
          if (distance <= enough) return entry.index;
          if (distance < best_distance || (distance == best_distance && entry.index < best)) {
            best_distance = distance;
            best = entry.index;
          }
        }
      }
    }
  }
  return best;
}

}  // namespace spba
