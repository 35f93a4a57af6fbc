// Everything that a residual block reads, computed once per evaluation point instead of once per pixel:
// X(s), rotations and their derivatives, points in every camera, and the correspondences of Eq. 5.
#ifndef SPBA_STATE_H_
#define SPBA_STATE_H_

#include <ceres/ceres.h>

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "nearest.h"
#include "spba/camera.h"

namespace spba {

using Matrix3 = Eigen::Matrix3d;
using Vector2 = Eigen::Vector2d;
using Vector3 = Eigen::Vector3d;
using Vector6 = Eigen::Matrix<double, 6, 1>;

// The unknowns; the memory that Ceres's parameter blocks point to.
struct Variables {
  Vector6 target_from_object;   // p0
  std::vector<Vector6> motion;  // dp_l at l - 1
  std::vector<double> style;    // s
  double log_alpha = 0.0;       // of Eq. 6
};

// X = G(s) for a prefix of the prior's points, row-major 3N and 3N x S; throws when the prior fails.
struct Prior {
  std::function<void(const std::vector<double>& style, std::vector<double>* points)> points;
  std::function<void(const std::vector<double>& style, std::vector<double>* jacobian)> jacobian;
};

// What one frame contributes to the evaluation.
struct FrameInput {
  Pinhole camera;
  std::unique_ptr<SilhouetteLookup> silhouette;
  std::vector<Vector2> silhouette_pixels;  // U_l1, perhaps subsampled
  int silhouette_points = 0;               // how many points of the prefix are paired with pixels
};

struct FrameState {
  Matrix3 rotation;                    // camera_from_object; its last row is zero under weak perspective
  Vector3 translation;                 // camera_from_object
  Matrix3 d_target[3];                 // d rotation / d omega_0
  Matrix3 d_motion[3];                 // d rotation / d delta omega_l
  bool in_front = false;               // all points are; otherwise nothing below `points` holds
  std::vector<Vector3> points;         // in this camera
  std::vector<Vector2> pixels;         // of the points
  std::vector<Vector2> nearest_pixel;  // per point (the first silhouette_points): its silhouette pixel
  std::vector<int> nearest_point;      // per silhouette pixel: its point
};

class State : public ceres::EvaluationCallback {
 public:
  State(Prior prior, int point_count, int style_count)
      : prior_(std::move(prior)), points_(3 * point_count), jacobian_(3 * point_count * style_count) {
    variables.style.assign(style_count, 0.0);
  }

  // Called by Ceres whenever it moves; Ceres writes `variables` first.
  void PrepareForEvaluation(bool evaluate_jacobians, bool new_evaluation_point) override;

  // Brings the state up to date with `variables`, doing nothing that is already done. False on failure().
  bool Update(bool with_jacobian);

  // Forgets what is up to date, after the inputs changed.
  void Invalidate() { is_current_ = false; }

  int point_count() const { return static_cast<int>(points_.size() / 3); }
  int style_count() const { return static_cast<int>(variables.style.size()); }
  Eigen::Map<const Vector3> point(int j) const { return Eigen::Map<const Vector3>(&points_[3 * j]); }
  // dx_j/ds, 3 x S row-major.
  const double* point_jacobian(int j) const { return &jacobian_[static_cast<size_t>(3) * j * style_count()]; }

  // Evaluations that Ceres asked for since the last reset, as Ceres counts them.
  struct Counts {
    uint32_t residual = 0, jacobian = 0;
  };
  const Counts& counts() const { return counts_; }
  void ResetCounts() { counts_ = {}; }

  // Why the prior could not be evaluated; empty while all is well.
  const std::string& failure() const { return failure_; }

  Variables variables;
  std::vector<FrameInput> inputs;
  double silhouette_tolerance = 0.0;  // pixels
  // Every point projects as if it had the depth of the object's origin (Zhu et al.).
  bool weak_perspective = false;
  std::vector<FrameState> frames;

 private:
  void UpdateFrame(int l);

  Prior prior_;
  std::vector<double> points_;
  std::vector<double> jacobian_;
  Variables current_;
  bool is_current_ = false;
  bool jacobian_is_current_ = false;
  Counts counts_;
  std::string failure_;
};

}  // namespace spba

#endif  // SPBA_STATE_H_
