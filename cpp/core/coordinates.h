// The parameter blocks in which Ceres moves the variables.
#ifndef SPBA_CORE_COORDINATES_H_
#define SPBA_CORE_COORDINATES_H_

#include <vector>

#include "core/variables.h"

namespace spba {

// How the poses move in one solver call.
enum class PoseMotion {
  kHeld,
  kEach,      // each by itself
  kSources,   // each but the target's: the paper's dp_l
  kTogether,  // all as p0 moves them: R_l = R(dw_l) R_0, t_l = dt_l + t_0 with dp_l held
};

struct Free {
  PoseMotion poses = PoseMotion::kEach;
  bool style = true, log_alpha = true, log_focal = false;
};

// Twists about the poses at the start, and style, log alpha and log focal themselves. Moving p0 by a twist
// [omega; t] turns frame l by R(dw_l) omega, exactly and not to first order alone, so that the paper's p0 and
// dp_l are a linear change of these coordinates.
class Coordinates {
 public:
  Coordinates(const Variables& start, const Free& free, int target);

  struct Block {
    size_t offset;  // in values()
    int size;
  };
  // The free ones.
  const std::vector<Block>& blocks() const { return blocks_; }
  int free_count() const { return free_count_; }

  // All values, free or not; what Ceres's parameter blocks point into.
  const std::vector<double>& values() const { return values_; }
  double* Values(const Block& block) { return &values_[block.offset]; }
  void SetValues(const std::vector<double>& values) { values_ = values; }
  // Sets the free blocks.
  void SetBlocks(double const* const* parameters);

  Variables Current() const;

  // The block that moves frame l, for residual blocks, which have one whether or not it is free; with
  // kTogether it is the same for all frames.
  double* PoseBlock(int l) {
    return &values_[6 * static_cast<size_t>(free_.poses == PoseMotion::kTogether ? 0 : l)];
  }
  double* StyleBlock() { return &values_[style_]; }
  double* LogAlphaBlock() { return &values_[style_ + start_.style.size()]; }
  double* LogFocalBlock() { return &values_[style_ + start_.style.size() + 1]; }
  bool IsFree(const double* block) const;
  const Free& free() const { return free_; }

  // Twist of frame l about its current rotation by omega of its block.
  Matrix3 ByOmega(int l) const;

  // Of Layout to the free coordinates, in the order of blocks().
  Eigen::VectorXd Gradient(const Eigen::VectorXd& of_layout) const;
  RowMajorMatrix NormalMatrix(const RowMajorMatrix& of_layout) const;

 private:
  // J^T rows, J being the derivative of Layout's tangents by the free coordinates.
  RowMajorMatrix Reduced(const RowMajorMatrix& rows) const;

  const Variables start_;
  const Free free_;
  const int target_;
  const Layout layout_;
  size_t style_;                // where it stands in values_
  std::vector<double> values_;  // poses (6 each, or 6 in all), style, log alpha, log focal
  std::vector<Block> blocks_;
  int free_count_ = 0;
};

}  // namespace spba

#endif  // SPBA_CORE_COORDINATES_H_
