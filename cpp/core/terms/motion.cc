#include "core/terms/motion.h"

#include <cmath>

#include "core/blocks.h"

namespace spba {
namespace {

constexpr int kResiduals = 3 * kMotionPoints;
using Residual = Eigen::Matrix<double, kResiduals, 1>;
using ByTwist = Eigen::Matrix<double, kResiduals, 6, Eigen::RowMajor>;

// The residual, whose squared norm is the mean over the points, and its derivatives by both twists.
struct Linearised {
  Residual residual;
  ByTwist by_a, by_b;
  Residual by_log_alpha;

  Linearised(const KnownMotion& motion, const Variables& variables) {
    using Jet = ceres::Jet<double, 7>;
    const Pose& a = variables.camera_from_object[static_cast<size_t>(motion.a)];
    const Pose& b = variables.camera_from_object[static_cast<size_t>(motion.b)];
    const double alpha = std::exp(variables.log_alpha), share = 1.0 / std::sqrt(double{kMotionPoints});
    for (int k = 0; k < kMotionPoints; ++k) {
      Vector3 point;
      MotionPoint(k, point.data());
      const Vector3 turned_a = a.rotation * point, turned_b = b.rotation * point;
      const Vector3 in_a = turned_a + a.translation, in_b = turned_b + b.translation;
      Jet a_jets[3], b_jets[3], output[3];
      for (int i = 0; i < 3; ++i) {
        a_jets[i] = Jet(in_a[i], i);
        b_jets[i] = Jet(in_b[i], 3 + i);
      }
      const Jet alpha_jet(alpha, 6);
      motion.error(a_jets, b_jets, &alpha_jet, output);
      for (int i = 0; i < 3; ++i) {
        const int row = 3 * k + i;
        residual[row] = share * output[i].a;
        const Eigen::RowVector3d of_a = share * output[i].v.head<3>().transpose();
        const Eigen::RowVector3d of_b = share * output[i].v.segment<3>(3).transpose();
        by_a.row(row) << -of_a * CrossProduct(turned_a), of_a;
        by_b.row(row) << -of_b * CrossProduct(turned_b), of_b;
        by_log_alpha[row] = share * output[i].v[6] * alpha;
      }
    }
  }
};

class MotionBlock : public AnyBlock {
 public:
  MotionBlock(const BlockState& state, const KnownMotion& motion)
      : AnyBlock(state, {motion.a, motion.b}, kResiduals, true), motion_(motion) {}

  bool Evaluate(double const* const*, double* residuals, double** jacobians) const override {
    if (!state_.usable()) return false;
    Linearised at(motion_, state_.variables());
    Eigen::Map<Residual>{residuals} = at.residual;
    if (jacobians == nullptr) return true;
    ToPoseBlock(motion_.a, kResiduals, at.by_a.data());
    ToPoseBlock(motion_.b, kResiduals, at.by_b.data());
    size_t next = 0;
    const auto put = [&](const ByTwist& by) {
      if (jacobians[next] != nullptr) Eigen::Map<ByTwist>{jacobians[next]} = by;
      ++next;
    };
    if (together_) {
      put(at.by_a + at.by_b);
    } else {
      put(at.by_a);
      put(at.by_b);
    }
    if (jacobians[next] != nullptr) {
      std::fill_n(jacobians[next], kResiduals * state_.views().style_count(), 0.0);
    }
    ++next;
    if (jacobians[next] != nullptr) Eigen::Map<Residual>{jacobians[next]} = at.by_log_alpha;
    ++next;
    if (with_focal_ && jacobians[next] != nullptr) std::fill_n(jacobians[next], kResiduals, 0.0);
    return true;
  }

 private:
  const KnownMotion motion_;
};

class MotionTerm : public Term {
 public:
  explicit MotionTerm(MotionOptions options)
      : options_(std::move(options)), weight_(options_.weight / options_.frames) {}

  void AddWhole(const Variables& variables, const Layout& layout, Want want,
                NormalEquations* sums) const override {
    const ceres::CauchyLoss loss(options_.cauchy_width);
    for (const KnownMotion& motion : options_.motions) {
      const Linearised at(motion, variables);
      double rho[3];
      loss.Evaluate(at.residual.squaredNorm(), rho);
      sums->costs[kMotion] += 0.5 * weight_ * rho[0];
      if (!want.derivatives()) continue;
      const double slope = weight_ * rho[1];
      const int a = layout.pose(motion.a), b = layout.pose(motion.b), alpha = layout.log_alpha();
      sums->gradient.segment<6>(a) += slope * at.by_a.transpose() * at.residual;
      sums->gradient.segment<6>(b) += slope * at.by_b.transpose() * at.residual;
      sums->gradient[alpha] += slope * at.by_log_alpha.dot(at.residual);
      if (!want.normal_matrix()) continue;
      RowMajorMatrix& matrix = sums->matrix;
      matrix.block<6, 6>(a, a) += slope * at.by_a.transpose() * at.by_a;
      matrix.block<6, 6>(b, b) += slope * at.by_b.transpose() * at.by_b;
      if (motion.a < motion.b) {
        matrix.block<6, 6>(a, b) += slope * at.by_a.transpose() * at.by_b;
      } else {
        matrix.block<6, 6>(b, a) += slope * at.by_b.transpose() * at.by_a;
      }
      matrix.block<6, 1>(a, alpha) += slope * at.by_a.transpose() * at.by_log_alpha;
      matrix.block<6, 1>(b, alpha) += slope * at.by_b.transpose() * at.by_log_alpha;
      matrix(alpha, alpha) += slope * at.by_log_alpha.squaredNorm();
    }
  }

  void AddBlocks(const Visibility&, BlockProblem* problem) const override {
    ceres::LossFunction* const loss = problem->Own(std::make_unique<ceres::ScaledLoss>(
        new ceres::CauchyLoss(options_.cauchy_width), weight_, ceres::TAKE_OWNERSHIP));
    for (const KnownMotion& motion : options_.motions) {
      problem->Add(std::make_unique<MotionBlock>(problem->state(), motion), loss);
    }
  }

 private:
  const MotionOptions options_;
  const double weight_;
};

}  // namespace

std::unique_ptr<const Term> MakeMotionTerm(MotionOptions options) {
  return std::make_unique<MotionTerm>(std::move(options));
}

}  // namespace spba
