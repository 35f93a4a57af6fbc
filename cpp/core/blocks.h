// The objective as residual blocks for Ceres, one a residual: the form of the paper, and what hosts build
// from the functors in include/spba. The oracle of the accumulated evaluation.
//
// Each block differentiates its functor by autodiff over the points that a pixel sees, in camera coordinates,
// and carries the derivative on to the variables by the chain rule. The variables' values come from
// BlockState, which Ceres brings up to date before it evaluates any block. Residuals come with soft tails
// (tails.h) beyond the width of the block's loss.
#ifndef SPBA_CORE_BLOCKS_H_
#define SPBA_CORE_BLOCKS_H_

#include <ceres/ceres.h>
#include <ceres/jet.h>

#include <map>
#include <memory>
#include <optional>
#include <tuple>
#include <vector>

#include "core/coordinates.h"
#include "core/objective.h"

namespace spba {

// What all blocks read, at the coordinates' current values.
class BlockState : public ceres::EvaluationCallback {
 public:
  BlockState(const Objective& objective, const Visibility& visibility, Coordinates* coordinates,
             Counts* counts)
      : objective_(objective), visibility_(visibility), coordinates_(*coordinates), counts_(*counts) {}

  void PrepareForEvaluation(bool evaluate_jacobians, bool new_evaluation_point) override;

  // Without it every block's evaluation fails.
  bool usable() const { return usable_; }
  // Why not; empty where all is well.
  const std::string& failure() const { return failure_; }
  const Views& views() const { return *views_; }
  const Variables& variables() const { return variables_; }
  const Visit* visit(const Term* term) const { return visits_.at(term).get(); }
  const Objective& objective() const { return objective_; }
  Coordinates& coordinates() const { return coordinates_; }
  const Matrix3& by_omega(int l) const { return by_omega_[static_cast<size_t>(l)]; }

 private:
  const Objective& objective_;
  const Visibility& visibility_;
  Coordinates& coordinates_;
  Counts& counts_;
  ShapeMemory memory_;
  bool usable_ = false;
  std::string failure_;
  Variables variables_;
  std::optional<Views> views_;
  std::map<const Term*, std::unique_ptr<const Visit>> visits_;
  std::vector<Matrix3> by_omega_;
};

// Parameter blocks: the poses of `frames` (one for all where they move together), the style, log alpha if
// `with_alpha`, and log focal where it is free.
class AnyBlock : public ceres::CostFunction {
 public:
  AnyBlock(const BlockState& state, std::vector<int> frames, int residuals, bool with_alpha);
  std::vector<double*> Parameters() const;

 protected:
  Vector3 InCamera(int of_frames, int point) const {
    return state_.views().InCamera(frames_[static_cast<size_t>(of_frames)], point);
  }
  double Alpha() const { return std::exp(state_.variables().log_alpha); }
  // Columns of a pose's twist to those of its parameter block; `jacobian` is rows x 6, row-major.
  void ToPoseBlock(int l, int rows, double* jacobian) const;

  const BlockState& state_;
  const std::vector<int> frames_;
  const bool together_, with_alpha_, with_focal_;
};

// A residual of one point, or of none.
template <int kResiduals>
class Block : public AnyBlock {
 public:
  using ByPosition = Eigen::Matrix<double, kResiduals, 3, Eigen::RowMajor>;

  // Beyond `width` the tail is soft.
  Block(const BlockState& state, std::vector<int> frames, double width, bool with_alpha)
      : AnyBlock(state, std::move(frames), kResiduals, with_alpha), width_(width) {}

 protected:
  // Changes the residual; its Jacobian is to be multiplied by what this returns.
  Eigen::Matrix<double, kResiduals, kResiduals> Soften(double* residuals) const {
    return SoftenTail<kResiduals>(width_, residuals);
  }

  // The Jacobians from the derivatives by the point's position in each of frames_ and, if given, by log
  // alpha.
  void ChainRule(int point, const ByPosition* by_position, const double* by_log_alpha,
                 double** jacobians) const {
    using Rows = Eigen::Map<Eigen::Matrix<double, kResiduals, Eigen::Dynamic, Eigen::RowMajor>>;
    const Views& views = state_.views();
    const int styles = views.style_count();
    const size_t poses = together_ ? 1 : frames_.size();
    for (size_t i = 0; i < poses; ++i) {
      if (jacobians[i] != nullptr) std::fill_n(jacobians[i], 6 * kResiduals, 0.0);
    }
    ByPosition by_point = ByPosition::Zero();
    Eigen::Matrix<double, kResiduals, 1> by_focal = Eigen::Matrix<double, kResiduals, 1>::Zero();
    for (size_t i = 0; i < frames_.size(); ++i) {
      const int l = frames_[i];
      by_point += by_position[i] * views.frame(l).linear;
      if (with_focal_) by_focal += by_position[i] * Views::ByLogFocal(views.InCamera(l, point));
      double* const by_pose = jacobians[together_ ? 0 : i];
      if (by_pose == nullptr) continue;
      Eigen::Matrix<double, kResiduals, 6, Eigen::RowMajor> of_frame =
          by_position[i] * views.ByPose(l, point);
      ToPoseBlock(l, kResiduals, of_frame.data());
      Eigen::Map<Eigen::Matrix<double, kResiduals, 6, Eigen::RowMajor>>(by_pose) += of_frame;
    }
    if (jacobians[poses] != nullptr) {
      Rows(jacobians[poses], kResiduals, styles).noalias() =
          by_point * Eigen::Map<const RowMajorMatrix>(views.PointJacobian(point), 3, styles);
    }
    double* const alpha = with_alpha_ ? jacobians[poses + 1] : nullptr;
    if (alpha != nullptr) std::copy_n(by_log_alpha, kResiduals, alpha);
    double* const focal = with_focal_ ? jacobians[poses + (with_alpha_ ? 2 : 1)] : nullptr;
    if (focal != nullptr) std::copy_n(by_focal.data(), kResiduals, focal);
  }

  // Evaluates a functor of the point in the block's only frame.
  template <typename Functor>
  bool EvaluateOneView(const Functor& functor, int point, double* residuals, double** jacobians) const {
    const Vector3 position = InCamera(0, point);
    if (jacobians == nullptr) {
      if (!functor(position.data(), residuals)) return false;
      Soften(residuals);
      return true;
    }
    using Jet = ceres::Jet<double, 3>;
    const Jet jets[3] = {Jet(position[0], 0), Jet(position[1], 1), Jet(position[2], 2)};
    Jet outputs[kResiduals];
    if (!functor(jets, outputs)) return false;
    ByPosition by_position;
    for (int r = 0; r < kResiduals; ++r) {
      residuals[r] = outputs[r].a;
      by_position.row(r) = outputs[r].v.transpose();
    }
    by_position = Soften(residuals) * by_position;
    ChainRule(point, &by_position, nullptr, jacobians);
    return true;
  }

 private:
  const double width_;
};

// The problem that terms fill.
class BlockProblem {
 public:
  BlockProblem(const Objective& objective, const Visibility& visibility, Coordinates* coordinates,
               Counts* counts);

  const BlockState& state() const { return state_; }
  ceres::Problem& problem() { return problem_; }

  void Add(std::unique_ptr<AnyBlock> block, ceres::LossFunction* loss);
  void Add(std::unique_ptr<ceres::CostFunction> cost, ceres::LossFunction* loss,
           const std::vector<double*>& parameters);
  // weight rho with the soft tail; lives as long as this.
  ceres::LossFunction* Scaled(double weight, const Loss& loss);
  ceres::LossFunction* Own(std::unique_ptr<ceres::LossFunction> loss);

 private:
  BlockState state_;
  std::map<std::tuple<double, Loss::Kind, double>, ceres::LossFunction*> scaled_;
  std::vector<std::unique_ptr<ceres::LossFunction>> losses_;
  std::vector<std::unique_ptr<ceres::CostFunction>> costs_;
  ceres::Problem problem_;
};

}  // namespace spba

#endif  // SPBA_CORE_BLOCKS_H_
