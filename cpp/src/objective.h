// Eq. 9 as a ceres::Problem: its residual blocks, gathered by term.
#ifndef SPBA_OBJECTIVE_H_
#define SPBA_OBJECTIVE_H_

#include <ceres/ceres.h>

#include <deque>
#include <memory>
#include <vector>

#include "blocks.h"
#include "spba/motion.h"
#include "spba/style.h"

namespace spba {

// Weights and Huber widths of Eq. 9.
struct Weights {
  double photometric;
  double photometric_huber;    // delta_1
  double silhouette;           // lambda_1
  double silhouette_cauchy;    // pixels; 0 = none
  double inverse_depth;        // lambda_2
  double inverse_depth_huber;  // delta_2
  double style;                // of -log p(s) = |s|^2 / 2
  double style_reach;          // |s| from which it rises steeply; 0 = nowhere
  double motion;               // of what dp_l differs from Eq. 13's
  double motion_cauchy;        // object diagonals
};

// Residual blocks of one kind that share a loss. Filled first, added to a problem once complete.
template <typename Block>
struct BlockGroup {
  std::deque<Block> blocks;  // cost functions cannot move
  std::unique_ptr<ceres::LossFunction> loss;

  // Their share of the objective at the state that they read, which must be usable.
  double Cost() const {
    double sum = 0.0;
    for (const Block& block : blocks) {
      double residuals[3] = {0.0, 0.0, 0.0}, rho[3];
      block.Evaluate(nullptr, residuals, nullptr);
      loss->Evaluate(residuals[0] * residuals[0] + residuals[1] * residuals[1] + residuals[2] * residuals[2],
                     rho);
      sum += 0.5 * rho[0];
    }
    return sum;
  }
};

// Borrows the state, whose variables are the problem's parameter blocks.
class Objective {
 public:
  Objective(State* state, const Weights& weights);

  void AddPhotometric(int frame, const std::vector<uint32_t>& points, const std::vector<uint8_t>& directions,
                      const PhotometricError& error);
  void AddSilhouette(int frame, double pixel_weight, double point_weight);
  void AddInverseDepth(int frame, const std::vector<uint32_t>& points,
                       const std::vector<InverseDepthError>& errors);
  void AddMotion(int frame, const MotionError& error);

  ceres::Problem& problem() { return problem_; }

  // The terms' values at the state's current point, weights included.
  double PhotometricCost() const { return Sum(photometric_); }
  double SilhouetteCost() const { return Sum(point_to_silhouette_) + Sum(silhouette_to_point_); }
  double InverseDepthCost() const { return Sum(inverse_depth_); }
  double StyleCost() const;
  double MotionCost() const;

 private:
  template <typename Block>
  static double Sum(const std::deque<BlockGroup<Block>>& groups) {
    double sum = 0.0;
    for (const auto& group : groups) sum += group.Cost();
    return sum;
  }
  // `last` is a block's parameter block after p0, dp_l and s; null = none.
  template <typename Block>
  void AddToProblem(int frame, BlockGroup<Block>& group, double* last = nullptr);

  State* state_;
  Weights weights_;
  // Deques: the problem points into the groups.
  std::deque<BlockGroup<PhotometricBlock>> photometric_;
  std::deque<BlockGroup<PointToSilhouetteBlock>> point_to_silhouette_;
  std::deque<BlockGroup<SilhouetteToPointBlock>> silhouette_to_point_;
  std::deque<BlockGroup<InverseDepthBlock>> inverse_depth_;
  struct MotionBlock {
    int frame;
    std::unique_ptr<ceres::CostFunction> cost;
  };
  std::vector<MotionBlock> motion_;
  std::unique_ptr<ceres::LossFunction> motion_loss_;
  std::unique_ptr<ceres::CostFunction> style_block_;
  std::unique_ptr<ceres::LossFunction> style_loss_;
  ceres::Problem problem_;
};

}  // namespace spba

#endif  // SPBA_OBJECTIVE_H_
