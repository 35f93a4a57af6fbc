// A residual of one point of the shape prior as a cost function for the host's own ceres::Problem.
//
// Autodiff goes over the few numbers that matter, the point in each camera and the intrinsics, and over each
// pose by itself; the chain rule carries on to the style, of which there are dozens. With 32
// styles a photometric residual takes a seventh (kInObject) or a fifth (kInWorld) of the time of autodiff
// over all parameters, with the same Jacobian.
//
// Parameter blocks, in this order:
//   1. the pose of each view (Layout's blocks; photometric residuals have two views);
//   2. kInWorld: world_from_object, a pose of the same layout, and log_scale[1];
//      kInObject: log_alpha[1];
//   3. the style[S];
//   4. intrinsics [fx, fy, cx, cy]: none (kFixed), one for all views (kShared), or one a view (kEach).
//
// kInObject: the poses are camera_from_object, translations in object diagonals; alpha is object diagonals a
// unit of the off-the-shelf reconstruction, and only inverse depths depend on it.
// kInWorld: the poses are the host's own camera_from_world; the object lies in the world by the similarity
// x_world = exp(log_scale) R x_object + t, and alpha is exp(-log_scale). Then all poses and the similarity
// may be free only where other residuals hold the world: else seven directions change nothing, so hold the
// similarity, or two poses.
#ifndef SPBA_FUNCTORS_OBJECT_COST_H_
#define SPBA_FUNCTORS_OBJECT_COST_H_

#include <ceres/cost_function.h>
#include <ceres/jet.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "spba/functors/linear_shape.h"
#include "spba/functors/pose_layouts.h"
#include "spba/functors/residuals.h"

namespace spba {
inline namespace v0 {
namespace functors {

enum class Placement { kInObject, kInWorld };
enum class Intrinsics { kFixed, kShared, kEach };

template <typename Residual, typename Layout, Placement kPlacement = Placement::kInWorld,
          Intrinsics kIntrinsics = Intrinsics::kFixed>
class ObjectCost final : public ceres::CostFunction {
 public:
  static constexpr int kViews = Residual::kViews, kResiduals = Residual::kResiduals;

  // Borrows the shape, and the index of its point, which may change between evaluations. `cameras`: one a
  // view; where intrinsics are blocks, those count instead.
  ObjectCost(const LinearShape& shape, const std::uint32_t* point, const std::array<Pinhole, kViews>& cameras,
             const Residual& residual)
      : shape_(shape), point_(point), own_point_(0), cameras_(cameras), residual_(residual) {
    set_num_residuals(kResiduals);
    const auto add = [this](int size) { mutable_parameter_block_sizes()->push_back(size); };
    const int poses = kViews + (kPlacement == Placement::kInWorld ? 1 : 0);
    for (int i = 0; i < poses; ++i) {
      for (const int size : Layout::kSizes) add(size);
    }
    add(1);
    add(shape.style_count());
    for (int i = 0; i < kIntrinsicsBlocks; ++i) add(4);
  }
  // The same with a point that stays.
  ObjectCost(const LinearShape& shape, std::uint32_t point, const std::array<Pinhole, kViews>& cameras,
             const Residual& residual)
      : ObjectCost(shape, nullptr, cameras, residual) {
    own_point_ = point;
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const std::uint32_t j = point_ == nullptr ? own_point_ : *point_;
    const Eigen::Vector3d point = shape_.Point(j, parameters[kStyleBlock]);
    if (jacobians == nullptr) {
      SeenPoint<double> seen[kViews];
      for (int view = 0; view < kViews; ++view) {
        const auto blocks = BlocksOf<double>(parameters, view);
        Place(blocks, point.data(), seen[view].in_camera, &seen[view].alpha);
        ReadIntrinsics(parameters, view, seen[view].intrinsics);
      }
      return residual_(seen, residuals);
    }
    return Differentiate(parameters, j, point, residuals, jacobians);
  }

 private:
  static constexpr bool kWorld = kPlacement == Placement::kInWorld;
  static constexpr int kPose = PoseSize<Layout>();
  static constexpr int kIntrinsicsBlocks =
      kIntrinsics == Intrinsics::kFixed ? 0 : (kIntrinsics == Intrinsics::kShared ? 1 : kViews);
  static constexpr int kScaleBlock = (kViews + (kWorld ? 1 : 0)) * Layout::kBlocks;
  static constexpr int kStyleBlock = kScaleBlock + 1;
  static constexpr int kIntrinsicsBlock = kStyleBlock + 1;
  // What all views share: world_from_object where there is one, the scale, and the point.
  static constexpr int kCommon = (kWorld ? kPose : 0) + 1 + 3;
  // Of a view: its pose, and what all share.
  static constexpr int kViewInputs = kPose + kCommon;
  // Of the residual: the point in each view, alpha, and the intrinsics.
  static constexpr int kResidualInputs = 3 * kViews + 1 + 4 * kIntrinsicsBlocks;
  using ResidualJet = ceres::Jet<double, kResidualInputs>;
  using ByCommon = Eigen::Matrix<double, 3, kCommon, Eigen::RowMajor>;
  using ByView = Eigen::Matrix<double, 3, kViewInputs, Eigen::RowMajor>;
  template <int kColumns>
  using ByRows = Eigen::Matrix<double, kResiduals, kColumns,
                               (kColumns == 1 && kResiduals > 1) ? Eigen::ColMajor : Eigen::RowMajor>;

  template <typename T>
  struct Blocks {
    std::array<const T*, static_cast<std::size_t>(Layout::kBlocks)> pose, world_from_object;
    const T* scale;
  };

  template <typename T>
  static Blocks<T> BlocksOf(T const* const* parameters, int view) {
    Blocks<T> blocks;
    for (int i = 0; i < Layout::kBlocks; ++i) {
      const auto at = static_cast<std::size_t>(i);
      blocks.pose[at] = parameters[view * Layout::kBlocks + i];
      blocks.world_from_object[at] = kWorld ? parameters[kViews * Layout::kBlocks + i] : nullptr;
    }
    blocks.scale = parameters[kScaleBlock];
    return blocks;
  }

  // The point in the camera, in object diagonals, and alpha.
  template <typename T>
  static void Place(const Blocks<T>& blocks, const T* point, T* in_camera, T* alpha) {
    using std::exp;
    if constexpr (kWorld) {
      const T scale = exp(blocks.scale[0]);
      const T scaled[3] = {scale * point[0], scale * point[1], scale * point[2]};
      T in_world[3];
      Layout::Apply(blocks.world_from_object.data(), scaled, in_world);
      Layout::Apply(blocks.pose.data(), in_world, in_camera);
      *alpha = 1.0 / scale;
      for (int i = 0; i < 3; ++i) in_camera[i] *= *alpha;
    } else {
      Layout::Apply(blocks.pose.data(), point, in_camera);
      *alpha = exp(blocks.scale[0]);
    }
  }

  template <typename T>
  void ReadIntrinsics(double const* const* parameters, int view, T* intrinsics) const {
    const Pinhole& camera = cameras_[static_cast<std::size_t>(view)];
    const double fixed[4] = {camera.fx, camera.fy, camera.cx, camera.cy};
    const int block = kIntrinsics == Intrinsics::kEach ? view : 0;
    const double* const values =
        kIntrinsics == Intrinsics::kFixed ? fixed : parameters[kIntrinsicsBlock + block];
    for (int i = 0; i < 4; ++i) intrinsics[i] = T(values[i]);
  }

  bool Differentiate(double const* const* parameters, std::uint32_t j, const Eigen::Vector3d& point,
                     double* residuals, double** jacobians) const {
    // From the object to where the views' poses take over, once; then each view by itself.
    Eigen::Vector3d before_views;
    const ByCommon by_common = PlaceObject(parameters, point, &before_views);
    const double alpha = std::exp(kWorld ? -parameters[kScaleBlock][0] : parameters[kScaleBlock][0]);
    ByView by_view[kViews];
    SeenPoint<ResidualJet> seen[kViews];
    for (int view = 0; view < kViews; ++view) {
      Eigen::Vector3d in_camera;
      by_view[view] = See(parameters, view, before_views, by_common, alpha, &in_camera);
      for (int i = 0; i < 3; ++i) seen[view].in_camera[i] = ResidualJet(in_camera[i], 3 * view + i);
      seen[view].alpha = ResidualJet(alpha, 3 * kViews);
      ReadIntrinsics(parameters, view, seen[view].intrinsics);
      if constexpr (kIntrinsicsBlocks > 0) {
        const int block = kIntrinsics == Intrinsics::kEach ? view : 0;
        for (int i = 0; i < 4; ++i) seen[view].intrinsics[i].v[3 * kViews + 1 + 4 * block + i] = 1.0;
      }
    }
    ResidualJet outputs[kResiduals];
    if (!residual_(seen, outputs)) return false;
    ByRows<kResidualInputs> by_inputs;
    for (int r = 0; r < kResiduals; ++r) {
      residuals[r] = outputs[r].a;
      by_inputs.row(r) = outputs[r].v.transpose();
    }
    ChainRule(j, by_inputs, by_view, kWorld ? -alpha : alpha, jacobians);
    return true;
  }

  // A pose's blocks as jets of the inputs 0, 1 ...
  template <typename Jet>
  static std::array<const Jet*, static_cast<std::size_t>(Layout::kBlocks)> PoseJets(
      double const* const* blocks, Jet* jets) {
    std::array<const Jet*, static_cast<std::size_t>(Layout::kBlocks)> pose;
    int at = 0;
    for (int i = 0; i < Layout::kBlocks; ++i) {
      pose[static_cast<std::size_t>(i)] = jets + at;
      for (int k = 0; k < Layout::kSizes[static_cast<std::size_t>(i)]; ++k, ++at) {
        jets[at] = Jet(blocks[i][k], at);
      }
    }
    return pose;
  }

  // The point before the views' poses, in the world or the object, and its derivative.
  static ByCommon PlaceObject(double const* const* parameters, const Eigen::Vector3d& point,
                              Eigen::Vector3d* placed) {
    ByCommon by_common = ByCommon::Zero();
    if constexpr (kWorld) {
      using Jet = ceres::Jet<double, kCommon>;
      Jet pose[kPose], in_world[3];
      const auto blocks = PoseJets(parameters + kViews * Layout::kBlocks, pose);
      const Jet scale = exp(Jet(parameters[kScaleBlock][0], kPose));
      const Jet scaled[3] = {scale * Jet(point[0], kPose + 1), scale * Jet(point[1], kPose + 2),
                             scale * Jet(point[2], kPose + 3)};
      Layout::Apply(blocks.data(), scaled, in_world);
      for (int i = 0; i < 3; ++i) {
        (*placed)[i] = in_world[i].a;
        by_common.row(i) = in_world[i].v.transpose();
      }
    } else {
      *placed = point;
      by_common.template rightCols<3>().setIdentity();
    }
    return by_common;
  }

  // The point in a view's camera, in object diagonals, and its derivative by the view's pose and what is
  // common.
  static ByView See(double const* const* parameters, int view, const Eigen::Vector3d& before,
                    const ByCommon& by_common, double alpha, Eigen::Vector3d* in_camera) {
    using Jet = ceres::Jet<double, kPose + 3>;
    Jet pose[kPose], moved[3];
    const auto blocks = PoseJets(parameters + view * Layout::kBlocks, pose);
    const Jet x[3] = {Jet(before[0], kPose), Jet(before[1], kPose + 1), Jet(before[2], kPose + 2)};
    Layout::Apply(blocks.data(), x, moved);
    const double factor = kWorld ? alpha : 1.0;
    Eigen::Matrix<double, 3, kPose + 3, Eigen::RowMajor> by_inputs;
    for (int i = 0; i < 3; ++i) {
      (*in_camera)[i] = factor * moved[i].a;
      by_inputs.row(i) = factor * moved[i].v.transpose();
    }
    ByView by_view;
    by_view.template leftCols<kPose>() = by_inputs.template leftCols<kPose>();
    by_view.template rightCols<kCommon>() = by_inputs.template rightCols<3>() * by_common;
    // The unit grows with the scale.
    if (kWorld) by_view.col(kViewInputs - 4) -= *in_camera;
    return by_view;
  }

  void ChainRule(std::uint32_t j, const ByRows<kResidualInputs>& by_inputs, const ByView* by_view,
                 double alpha_by_scale, double** jacobians) const {
    ByRows<kCommon> common = ByRows<kCommon>::Zero();
    for (int view = 0; view < kViews; ++view) {
      const ByRows<kViewInputs> of_view = by_inputs.template middleCols<3>(3 * view) * by_view[view];
      Write(of_view.template leftCols<kPose>(), jacobians + view * Layout::kBlocks);
      common += of_view.template rightCols<kCommon>();
    }
    if constexpr (kWorld) Write(common.template leftCols<kPose>(), jacobians + kViews * Layout::kBlocks);
    if (double* const by_scale = jacobians[kScaleBlock]; by_scale != nullptr) {
      for (int r = 0; r < kResiduals; ++r) {
        by_scale[r] = common(r, kCommon - 4) + by_inputs(r, 3 * kViews) * alpha_by_scale;
      }
    }
    if (jacobians[kStyleBlock] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, kResiduals, Eigen::Dynamic, Eigen::RowMajor>>(
          jacobians[kStyleBlock], kResiduals, shape_.style_count())
          .noalias() = common.template rightCols<3>() * shape_.Basis(j);
    }
    for (int block = 0; block < kIntrinsicsBlocks; ++block) {
      double* const jacobian = jacobians[kIntrinsicsBlock + block];
      if (jacobian == nullptr) continue;
      Eigen::Map<ByRows<4>> by_intrinsics(jacobian);
      by_intrinsics = by_inputs.template middleCols<4>(3 * kViews + 1 + 4 * block);
    }
  }

  // The columns of a pose to its blocks.
  template <typename Columns>
  static void Write(const Columns& columns, double** jacobians) {
    int at = 0;
    for (int i = 0; i < Layout::kBlocks; ++i) {
      const int size = Layout::kSizes[static_cast<std::size_t>(i)];
      if (jacobians[i] != nullptr) {
        Eigen::Map<Eigen::Matrix<double, kResiduals, Eigen::Dynamic, Eigen::RowMajor>>(
            jacobians[i], kResiduals, size) = columns.middleCols(at, size);
      }
      at += size;
    }
  }

  const LinearShape& shape_;
  const std::uint32_t* const point_;
  std::uint32_t own_point_;
  const std::array<Pinhole, kViews> cameras_;
  const Residual residual_;
};

}  // namespace functors
}  // namespace v0
}  // namespace spba

#endif  // SPBA_FUNCTORS_OBJECT_COST_H_
