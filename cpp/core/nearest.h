// The two nearest-neighbour searches of Eq. 5, both exact.
#ifndef SPBA_CORE_NEAREST_H_
#define SPBA_CORE_NEAREST_H_

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

namespace spba {

// Nearest silhouette pixel of any image point, from a distance transform that also tells which pixel is
// nearest to each cell's centre (computed by the caller, on a grid padded around the image).
class SilhouetteLookup {
 public:
  // `nearest[row * grid_width + column]` = row-major index, in an image of `width` columns, of the silhouette
  // pixel nearest to the centre of cell (column - padding, row - padding).
  // `boundary` = indices of the silhouette's boundary pixels, for points beyond the grid.
  SilhouetteLookup(int width, int padding, int grid_width, int grid_height, std::vector<uint32_t> nearest,
                   std::vector<uint32_t> boundary);

  // Centre of the silhouette pixel nearest to `point` (pixels), or of any that is no farther than
  // `near_enough`.
  Eigen::Vector2d Nearest(const Eigen::Vector2d& point, double near_enough) const;

 private:
  Eigen::Vector2d Centre(uint32_t index) const;

  int width_, padding_, grid_width_, grid_height_;
  std::vector<uint32_t> nearest_;
  std::vector<uint32_t> boundary_;
};

// Nearest projected point of any pixel: points in square cells, searched ring by ring.
class PointGrid {
 public:
  // Cells cover the bounding box of `points` (pixels); the points must be finite and not empty.
  explicit PointGrid(const std::vector<Eigen::Vector2d>& points);

  // Index of the point nearest to `pixel`, the lowest index of equals; or of any point that is no farther
  // than `near_enough`.
  int Nearest(const Eigen::Vector2d& pixel, double near_enough) const;

 private:
  struct Entry {
    double x, y;
    int index;
  };
  int Column(double x) const;
  int Row(double y) const;

  Eigen::Vector2d low_;
  double cell_size_, cells_per_pixel_;
  int columns_, rows_;
  std::vector<int> first_;            // cell -> its first entry; one more at the end
  std::unique_ptr<Entry[]> entries_;  // cell after cell
};

}  // namespace spba

#endif  // SPBA_CORE_NEAREST_H_
