// Normal equations, and how one point's residuals enter them.
#ifndef SPBA_CORE_SYSTEM_H_
#define SPBA_CORE_SYSTEM_H_

#include <array>
#include <limits>
#include <vector>

#include "core/footage.h"
#include "core/loss.h"
#include "core/views.h"

namespace spba {

// What a functor leaves where it refuses a point: the cost is not finite then, and the evaluation fails.
constexpr double kNotEvaluated = std::numeric_limits<double>::quiet_NaN();

// The terms of the objective, in the order of Costs.
enum TermIndex { kPhotometric, kSilhouette, kInverseDepth, kStyle, kMotion, kFocal, kTerms };
using Costs = std::array<double, kTerms>;

// What an evaluation is asked for.
struct Want {
  // Each includes the ones before.
  enum class Order { kCost, kGradient, kNormalMatrix };
  Order order = Order::kCost;
  // Whether derivatives by the style and by log focal are among it; else theirs stay zero.
  bool style = true, focal = true;

  bool derivatives() const { return order != Order::kCost; }
  bool normal_matrix() const { return order == Order::kNormalMatrix; }
};

// Sums over residuals, laid out as Layout says. The normal matrix's upper triangle holds until Symmetrise.
struct NormalEquations {
  Costs costs{};
  Eigen::VectorXd gradient;
  RowMajorMatrix matrix;

  NormalEquations(const Layout& layout, Want want);
  void Add(const NormalEquations& other);
  void SetZero();
  void Symmetrise();
};

// A point as one camera sees it, with the sums over the residuals that look at it there.
struct PointView {
  int frame;
  Vector3 position;  // in the camera
  // The image's colour there and its derivative by the position, once asked for.
  bool has_colour;
  Vector3 colour;
  Matrix3 colour_by_position;

  Vector3 gradient;    // of the cost by the position
  Matrix3 curvature;   // by the position twice, but for
  double by_colour;    // times the square of colour_by_position
  Vector3 with_alpha;  // by the position and log alpha
};

// The derivative of a position in the camera by a twist [omega; t] is [-diag(turn) [R x]x,
// diag(translation)].
struct TwistScales {
  Vector3 turn, translation;
  explicit TwistScales(const Views& views)
      : turn(views.focal(), views.focal(), views.weak_perspective() ? 0.0 : 1.0),
        translation(views.focal(), views.focal(), 1.0) {}
};

// Collects the residuals of one point after another: first as 3-vectors and 3 x 3 blocks between the cameras
// that see it, then, once per point, times the derivatives of these positions by the variables.
//
// Holds buffers alone; one a thread of evaluations.
class PointSystem {
 public:
  PointSystem(const Views& views, const Footage& footage, int level, Want want);

  // Residuals added from now on are those of point j.
  void Begin(int j);
  // Adds what was collected for that point to the sums.
  void Finish(NormalEquations* sums);
  // Adds what Finish still holds back; to be called after the last point.
  void Flush(NormalEquations* sums);

  bool with_derivatives() const { return want_.derivatives(); }
  Costs& costs() { return costs_; }

  // How camera l sees the point. Holds until Finish.
  PointView& View(int l);
  // The same with its colour.
  PointView& ColouredView(int l);

  // A residual of one view: its derivative by the position.
  template <int kResiduals>
  void Add(PointView* view, const Weighed<kResiduals>& weighed,
           const Eigen::Matrix<double, kResiduals, 1>& residual,
           const Eigen::Matrix<double, kResiduals, 3>& by_position) {
    view->gradient.noalias() += by_position.transpose() * weighed.slope;
    if (!want_.normal_matrix()) return;
    AddProduct(weighed.across, by_position, by_position, &view->curvature);
    if (weighed.less_along != 0.0) {
      const Eigen::Matrix<double, 1, 3> along = residual.transpose() * by_position;
      AddProduct(-weighed.across * weighed.less_along, along, along, &view->curvature);
    }
  }
  // One that log alpha moves too.
  void AddWithAlpha(PointView* view, const Weighed<1>& weighed, double residual,
                    const Eigen::Matrix<double, 1, 3>& by_position, double by_log_alpha);
  // The difference of two views' colours.
  void AddDifference(PointView* a, PointView* b, const Weighed<3>& weighed, const Vector3& residual);

 private:
  struct PairBlock {
    int a, b;  // slots
    Matrix3 curvature;
  };
  int Slot(int l);
  // matrix += weight a^T b, written out: Eigen makes a call of it.
  template <int kRows>
  static void AddProduct(double weight, const Eigen::Matrix<double, kRows, 3>& a,
                         const Eigen::Matrix<double, kRows, 3>& b, Matrix3* matrix) {
    for (int c = 0; c < 3; ++c) {
      for (int r = 0; r < 3; ++r) {
        double sum = 0.0;
        for (int k = 0; k < kRows; ++k) sum += a(k, r) * b(k, c);
        (*matrix)(r, c) += weight * sum;
      }
    }
  }
  // Styles [begin, end) move points along one axis alone.
  struct StyleRun {
    int axis, begin, end;
    int count() const { return end - begin; }
  };
  // target (1 x S, its entries `stride` apart) += a^T X for a 3-vector a and X = dx/ds.
  void AddRow(const Vector3& a, const double* x, double* target, Eigen::Index stride) const;
  // The six rows of `target`, `stride` apart, += a^T X for a 3 x 6 matrix a.
  void AddRows(const Matrix36& a, const double* x, double* target, Eigen::Index stride) const;
  void FlushStyles(NormalEquations* sums);

  const Views& views_;
  const Footage& footage_;
  const int level_;
  const Want want_;
  const TwistScales scales_;
  Costs costs_{};

  int point_ = 0;
  std::vector<PointView> seen_;  // by slot
  std::vector<int> slots_;       // by frame; -1 = not seen yet
  std::vector<PairBlock> pairs_;
  double alpha_gradient_ = 0.0, alpha_curvature_ = 0.0;
  // The styles before the runs move points any way.
  int dense_styles_ = 0;
  std::vector<StyleRun> runs_;
  // Style by style, whose sums come in batches: sum X^T (V X) over points, X and V X stacked, axis after
  // axis.
  static constexpr int kBatch = 64;
  int batched_ = 0;
  RowMajorMatrix batch_x_, batch_vx_;
  std::vector<Matrix3> by_style_;  // by slot: curvature of the position there and the object's point
  std::vector<Vector3> turned_;    // by slot: R x
  std::vector<Vector3> with_focal_by_position_;  // by slot
};

}  // namespace spba

#endif  // SPBA_CORE_SYSTEM_H_
