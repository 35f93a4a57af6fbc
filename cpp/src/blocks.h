// The residual blocks of Eq. 9. Each differentiates its functor (include/spba) by autodiff over the points
// that a pixel sees, in camera coordinates, and carries the derivative on to p0, dp_l and s by the chain rule
// with what State caches.
//
// Parameter blocks: (p0, s) where only the target frame is concerned, else (p0, dp_l, s); Eq. 6 adds log
// alpha. The parameters' values come from State, which Ceres brings up to date before it evaluates any block.
// Residuals come with soft tails (tails.h) beyond the width of the block's loss.
#ifndef SPBA_BLOCKS_H_
#define SPBA_BLOCKS_H_

#include <ceres/jet.h>

#include "spba/inverse_depth.h"
#include "spba/photometric.h"
#include "spba/silhouette.h"
#include "spba/tails.h"
#include "state.h"

namespace spba {

template <int kResiduals>
using PointJacobian = Eigen::Matrix<double, kResiduals, 3, Eigen::RowMajor>;

// points[i] as jets whose derivative slots begin at 3 i.
template <int kSlots>
void SeedJets(const double* point, int first_slot, ceres::Jet<double, kSlots>* jets) {
  for (int i = 0; i < 3; ++i) jets[i] = ceres::Jet<double, kSlots>(point[i], first_slot + i);
}

// What all blocks share: the parameter layout and the chain rule.
template <int kResiduals>
class Block : public ceres::CostFunction {
 public:
  Block(const State& state, int frame, double width) : state_(state), frame_(frame), width_(width) {
    set_num_residuals(kResiduals);
    mutable_parameter_block_sizes()->push_back(6);
    if (frame > 0) mutable_parameter_block_sizes()->push_back(6);
    mutable_parameter_block_sizes()->push_back(state.style_count());
  }

 protected:
  bool Usable(int frame) const { return state_.failure().empty() && state_.frames[frame].in_front; }
  const double* PointInCamera(int frame, int point) const {
    return state_.frames[frame].points[point].data();
  }

  // jacobians of the parameter blocks from the residual's derivatives by the point in camera `frame_` and, if
  // given, by the point in the target camera.
  void ChainRule(int point, const PointJacobian<kResiduals>& by_frame,
                 const PointJacobian<kResiduals>* by_target, double** jacobians) const {
    using PoseJacobian = Eigen::Map<Eigen::Matrix<double, kResiduals, 6, Eigen::RowMajor>>;
    const FrameState& frame = state_.frames[frame_];
    const FrameState& target = state_.frames[0];
    const Vector3 x = state_.point(point);
    if (jacobians[0] != nullptr) {
      PoseJacobian by_p0(jacobians[0]);
      for (int k = 0; k < 3; ++k) by_p0.col(k) = by_frame * (frame.d_target[k] * x);
      by_p0.template rightCols<3>() = by_frame;
      if (by_target != nullptr) {
        for (int k = 0; k < 3; ++k) by_p0.col(k) += *by_target * (target.d_target[k] * x);
        by_p0.template rightCols<3>() += *by_target;
      }
    }
    if (frame_ > 0 && jacobians[1] != nullptr) {
      PoseJacobian by_motion(jacobians[1]);
      for (int k = 0; k < 3; ++k) by_motion.col(k) = by_frame * (frame.d_motion[k] * x);
      by_motion.template rightCols<3>() = by_frame;
    }
    double* by_style = jacobians[frame_ > 0 ? 2 : 1];
    if (by_style != nullptr) {
      PointJacobian<kResiduals> by_point = by_frame * frame.rotation;
      if (by_target != nullptr) by_point += *by_target * target.rotation;
      const int s = state_.style_count();
      const double* dx = state_.point_jacobian(point);
      for (int r = 0; r < kResiduals; ++r) {
        for (int c = 0; c < s; ++c) {
          by_style[r * s + c] =
              by_point(r, 0) * dx[c] + by_point(r, 1) * dx[s + c] + by_point(r, 2) * dx[2 * s + c];
        }
      }
    }
  }

  // Evaluates a functor of one point in camera `frame_`.
  template <typename Functor>
  bool EvaluateOnePoint(const Functor& functor, int point, double* residuals, double** jacobians) const {
    if (!Usable(frame_)) return false;
    const double* in_frame = PointInCamera(frame_, point);
    if (jacobians == nullptr) {
      if (!functor(in_frame, residuals)) return false;
      SoftenTail<kResiduals>(width_, residuals);
      return true;
    }
    ceres::Jet<double, 3> jets[3], outputs[kResiduals];
    SeedJets(in_frame, 0, jets);
    if (!functor(jets, outputs)) return false;
    PointJacobian<kResiduals> by_frame;
    for (int r = 0; r < kResiduals; ++r) {
      residuals[r] = outputs[r].a;
      by_frame.row(r) = outputs[r].v.transpose();
    }
    by_frame = SoftenTail<kResiduals>(width_, residuals) * by_frame;
    ChainRule(point, by_frame, nullptr, jacobians);
    return true;
  }

  const State& state_;
  const int frame_;
  // Of the loss: beyond it the tail begins.
  const double width_;
};

// Eq. 4 for one point and one source frame.
class PhotometricBlock : public Block<3> {
 public:
  PhotometricBlock(const State& state, int frame, double width, int point, const PhotometricError& error)
      : Block(state, frame, width), point_(point), error_(error) {}

  bool Evaluate(double const* const*, double* residuals, double** jacobians) const override {
    if (!Usable(0) || !Usable(frame_)) return false;
    const double* in_target = PointInCamera(0, point_);
    const double* in_frame = PointInCamera(frame_, point_);
    if (jacobians == nullptr) {
      if (!error_(in_target, in_frame, residuals)) return false;
      SoftenTail<3>(width_, residuals);
      return true;
    }
    ceres::Jet<double, 6> target_jets[3], frame_jets[3], outputs[3];
    SeedJets(in_target, 0, target_jets);
    SeedJets(in_frame, 3, frame_jets);
    if (!error_(target_jets, frame_jets, outputs)) return false;
    PointJacobian<3> by_target, by_frame;
    for (int r = 0; r < 3; ++r) {
      residuals[r] = outputs[r].a;
      by_target.row(r) = outputs[r].v.head<3>().transpose();
      by_frame.row(r) = outputs[r].v.tail<3>().transpose();
    }
    const Eigen::Matrix3d softened = SoftenTail<3>(width_, residuals);
    by_target = softened * by_target;
    by_frame = softened * by_frame;
    ChainRule(point_, by_frame, &by_target, jacobians);
    return true;
  }

 private:
  const int point_;
  const PhotometricError& error_;
};

// Eq. 5, second sum: a point and the silhouette pixel nearest to it now.
class PointToSilhouetteBlock : public Block<1> {
 public:
  PointToSilhouetteBlock(const State& state, int frame, double width, int point)
      : Block(state, frame, width), point_(point) {}

  bool Evaluate(double const* const*, double* residuals, double** jacobians) const override {
    if (!Usable(frame_)) return false;
    const Vector2& pixel = state_.frames[frame_].nearest_pixel[point_];
    const SilhouetteError error{
        state_.inputs[frame_].camera, {pixel.x(), pixel.y()}, state_.silhouette_tolerance};
    return EvaluateOnePoint(error, point_, residuals, jacobians);
  }

 private:
  const int point_;
};

// Eq. 5, first sum: a silhouette pixel and the point whose projection is nearest to it now.
class SilhouetteToPointBlock : public Block<1> {
 public:
  SilhouetteToPointBlock(const State& state, int frame, double width, int pixel)
      : Block(state, frame, width), pixel_(pixel) {}

  bool Evaluate(double const* const*, double* residuals, double** jacobians) const override {
    if (!Usable(frame_)) return false;
    const FrameInput& input = state_.inputs[frame_];
    const Vector2& pixel = input.silhouette_pixels[pixel_];
    const SilhouetteError error{input.camera, {pixel.x(), pixel.y()}, state_.silhouette_tolerance};
    return EvaluateOnePoint(error, state_.frames[frame_].nearest_point[pixel_], residuals, jacobians);
  }

 private:
  const int pixel_;
};

// Eq. 6 at one pixel. Its last parameter block is log alpha: a scale is positive.
class InverseDepthBlock : public Block<1> {
 public:
  InverseDepthBlock(const State& state, int frame, double width, int point, const InverseDepthError& error)
      : Block(state, frame, width), point_(point), error_(error) {
    mutable_parameter_block_sizes()->push_back(1);
  }

  bool Evaluate(double const* const*, double* residuals, double** jacobians) const override {
    if (!Usable(frame_)) return false;
    const double alpha = std::exp(state_.variables.log_alpha);
    const double* in_frame = PointInCamera(frame_, point_);
    if (jacobians == nullptr) {
      if (!error_(in_frame, &alpha, residuals)) return false;
      SoftenTail<1>(width_, residuals);
      return true;
    }
    ceres::Jet<double, 4> point[3], alpha_jet(alpha, 3), output;
    SeedJets(in_frame, 0, point);
    if (!error_(point, &alpha_jet, &output)) return false;
    residuals[0] = output.a;
    const double softened = SoftenTail<1>(width_, residuals)(0);
    const PointJacobian<1> by_frame = softened * output.v.head<3>().transpose();
    ChainRule(point_, by_frame, nullptr, jacobians);
    double* by_log_alpha = jacobians[parameter_block_sizes().size() - 1];
    if (by_log_alpha != nullptr) *by_log_alpha = softened * output.v[3] * alpha;
    return true;
  }

 private:
  const int point_;
  const InverseDepthError error_;
};

}  // namespace spba

#endif  // SPBA_BLOCKS_H_
