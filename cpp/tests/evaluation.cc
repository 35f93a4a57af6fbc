// The accumulated evaluation against the residual blocks: cost, gradient, normal matrix and the steps of
// Levenberg-Marquardt, for every term and loss, at random and at awkward points; and what an evaluation must
// not depend on. Prints one line per check; exits with the number of failures.
#include <ceres/ceres.h>
#include <glog/logging.h>

#include <cmath>
#include <cstdio>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/accumulated_cost.h"
#include "core/blocks.h"
#include "core/minimise.h"
#include "tests/scene.h"

namespace {

using namespace spba;
using namespace spba::test;

struct Case {
  std::string name;
  std::unique_ptr<Objective> objective;
};

std::vector<Case> Cases(const Scene& scene, const Variables& start) {
  std::vector<Case> cases;
  const auto add = [&](const std::string& name, bool bent, bool weak) -> Objective& {
    cases.push_back({name, std::make_unique<Objective>(scene.footage, Ball(bent), weak)});
    return *cases.back().objective;
  };
  const auto silhouette = [&](double cauchy, double tolerance) {
    return MakeSilhouetteTerm(Silhouettes(scene, cauchy, tolerance));
  };
  add("photometric, wide Huber", false, false).Add(MakePhotometricTerm({1e-3, 1e4}));
  add("photometric, all in the tail", true, false).Add(MakePhotometricTerm({1e-3, 0.1}));
  add("photometric", true, false).Add(MakePhotometricTerm({1e-3, 20.0}));
  add("photometric, weak perspective", true, true).Add(MakePhotometricTerm({1e-3, 20.0}));
  add("silhouette, squares", true, false).Add(silhouette(0.0, 0.0));
  add("silhouette, Cauchy and tolerance", true, false).Add(silhouette(0.7, 0.5));
  add("silhouette, weak perspective", false, true).Add(silhouette(0.7, 0.5));
  add("inverse depth, wide Huber", true, false).Add(MakeInverseDepthTerm({1000.0, 10.0, kFrames}));
  add("inverse depth", true, false).Add(MakeInverseDepthTerm({1000.0, 0.003, kFrames}));
  add("style", false, false).Add(MakeStyleTerm({3.0}));
  add("motion", false, false).Add(MakeMotionTerm(Motions(start)));
  add("focal", false, false).Add(MakeFocalTerm({0.03}));
  AddAllTerms(scene, start, &add("all terms", false, false));
  cases.push_back({"all terms, styles along axes",
                   std::make_unique<Objective>(scene.footage, Ball(false, {{2, 1}, {0, 2}, {2, 1}}), false)});
  AddAllTerms(scene, start, cases.back().objective.get());
  return cases;
}

// Largest difference as a share of the largest entry.
template <typename A, typename B>
double Difference(const A& a, const B& b) {
  const double largest = std::max(a.cwiseAbs().maxCoeff(), 1e-300);
  return (a - b).cwiseAbs().maxCoeff() / largest;
}

Eigen::MatrixXd Dense(const ceres::CRSMatrix& matrix) {
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(matrix.num_rows, matrix.num_cols);
  for (int row = 0; row < matrix.num_rows; ++row) {
    for (int i = matrix.rows[static_cast<size_t>(row)]; i < matrix.rows[static_cast<size_t>(row) + 1]; ++i) {
      dense(row, matrix.cols[static_cast<size_t>(i)]) = matrix.values[static_cast<size_t>(i)];
    }
  }
  return dense;
}

// The accumulated evaluation at moved coordinates against Ceres's own sums over the blocks, and against
// differences of the cost.
void CompareAt(const std::string& name, const Objective& objective, const Visibility& visibility,
               const Variables& start, const Free& free, double move, bool numerically) {
  Coordinates coordinates(start, free, 1);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  std::vector<double> values = coordinates.values();
  for (const Coordinates::Block& block : coordinates.blocks()) {
    for (int i = 0; i < block.size; ++i) values[block.offset + static_cast<size_t>(i)] += move * unit(random);
  }
  coordinates.SetValues(values);

  Counts counts;
  BlockProblem blocks(objective, visibility, &coordinates, &counts);
  ceres::Problem::EvaluateOptions options;
  int column = 0;
  // Not every term has all blocks.
  std::vector<int> columns;
  for (const Coordinates::Block& block : coordinates.blocks()) {
    double* const at = coordinates.Values(block);
    if (blocks.problem().HasParameterBlock(at)) {
      options.parameter_blocks.push_back(at);
      for (int i = 0; i < block.size; ++i) columns.push_back(column + i);
    }
    column += block.size;
  }
  double cost = 0.0;
  std::vector<double> gradient;
  ceres::CRSMatrix jacobian;
  if (!blocks.problem().Evaluate(options, &cost, nullptr, &gradient, &jacobian)) {
    Check(name, false, "the blocks cannot be evaluated: " + blocks.state().failure());
    return;
  }
  const Eigen::MatrixXd dense = Dense(jacobian);
  const Eigen::MatrixXd squares = dense.transpose() * dense;
  Eigen::VectorXd expected_gradient = Eigen::VectorXd::Zero(column);
  Eigen::MatrixXd expected_matrix = Eigen::MatrixXd::Zero(column, column);
  for (size_t i = 0; i < columns.size(); ++i) {
    expected_gradient[columns[i]] = gradient[i];
    for (size_t k = 0; k < columns.size(); ++k) {
      expected_matrix(columns[i], columns[k]) = squares(static_cast<int>(i), static_cast<int>(k));
    }
  }

  ShapeMemory memory;
  const auto evaluate = [&](Want::Order order) {
    return objective.Evaluate(coordinates.Current(), visibility, {order, free.style, free.log_focal}, 1,
                              &memory);
  };
  const Evaluation found = evaluate(Want::Order::kNormalMatrix);
  const Eigen::VectorXd found_gradient = coordinates.Gradient(found.equations.gradient);
  const double of_cost = std::abs(found.Cost() - cost) / cost;
  const double without = std::abs(evaluate(Want::Order::kCost).Cost() - cost) / cost;
  const double of_gradient = Difference(expected_gradient, found_gradient);
  const double only_gradient = Difference(
      expected_gradient, coordinates.Gradient(evaluate(Want::Order::kGradient).equations.gradient));
  const double of_matrix = Difference(expected_matrix, coordinates.NormalMatrix(found.equations.matrix));
  char text[200];
  std::snprintf(text, sizeof(text), "cost %.1e, %.1e, gradient %.1e, %.1e, normal matrix %.1e", of_cost,
                without, of_gradient, only_gradient, of_matrix);
  Check(name, found.ok() && std::max({of_cost, without, of_gradient, only_gradient, of_matrix}) < 1e-9, text);

  const SquareRoot root(coordinates.NormalMatrix(found.equations.matrix), found_gradient);
  const double of_root = Difference(expected_matrix, (root.root.transpose() * root.root).eval());
  const double of_residual = Difference(expected_gradient, (root.root.transpose() * root.residual).eval());
  std::snprintf(text, sizeof(text), "R^T R %.1e, R^T r %.1e", of_root, of_residual);
  Check(name + ", square root", std::max(of_root, of_residual) < 1e-9, text);

  if (!numerically) return;
  Eigen::VectorXd numeric(column);
  int entry = 0;
  constexpr double kStep = 1e-7;
  for (const Coordinates::Block& block : coordinates.blocks()) {
    for (int i = 0; i < block.size; ++i) {
      const auto cost_at = [&](double step) {
        std::vector<double> moved = values;
        moved[block.offset + static_cast<size_t>(i)] += step;
        coordinates.SetValues(moved);
        return evaluate(Want::Order::kCost).Cost();
      };
      numeric[entry++] = (cost_at(kStep) - cost_at(-kStep)) / (2.0 * kStep);
    }
  }
  // Rounding of two costs over the step, and kinks where a nearest pixel changes.
  const double of_numeric = Difference(numeric, found_gradient);
  std::snprintf(text, sizeof(text), "%.1e", of_numeric);
  Check(name + ", against differences", of_numeric < 2e-4, text);
}

// The costs of Levenberg-Marquardt's iterations from the same start.
std::vector<double> Course(const Objective& objective, const Visibility& visibility, const Variables& start,
                           const Free& free, const MinimiseOptions& options, Variables* end) {
  std::vector<double> costs;
  *end = start;
  ShapeMemory memory;
  Minimise(
      objective, visibility, free, 1, options,
      [&](const IterationState& state) {
        double total = 0.0;
        for (const double cost : state.costs) total += cost;
        costs.push_back(total);
        return true;
      },
      &memory, end);
  return costs;
}

void CompareCourses(const std::string& name, const Objective& objective, const Visibility& visibility,
                    const Variables& start, const Free& free, bool line_search) {
  MinimiseOptions options;
  options.max_iterations = 12;
  options.tolerance = 0.0;
  options.line_search = line_search;
  Variables end, block_end;
  const std::vector<double> accumulated = Course(objective, visibility, start, free, options, &end);
  options.evaluation = EvaluationKind::kBlocks;
  const std::vector<double> blocks = Course(objective, visibility, start, free, options, &block_end);
  double largest = accumulated.size() == blocks.size() ? 0.0 : 1.0;
  for (size_t i = 0; i < std::min(accumulated.size(), blocks.size()); ++i) {
    largest = std::max(largest, std::abs(accumulated[i] - blocks[i]) / blocks[i]);
  }
  char text[200];
  std::snprintf(text, sizeof(text), "%zu iterations, %g to %g, costs differ by %.1e at most",
                blocks.size() - 1, blocks.front(), blocks.back(), largest);
  Check(name, largest < 1e-6 && blocks.size() > 10 && blocks.back() < 0.9 * blocks.front(), text);
}

// A failed evaluation is a failure, not a cost of 0, and leaves nothing behind.
void CheckFailures(const Scene& scene, const Variables& start) {
  bool fails = false;
  Prior prior = Ball(false);
  const auto points = prior.points;
  prior.points = [&fails, points](const std::vector<double>& style, std::vector<double>* out) {
    if (fails) throw std::runtime_error("the prior says no");
    points(style, out);
  };
  Objective objective(scene.footage, prior, false);
  objective.Add(MakePhotometricTerm({1e-3, 20.0}));
  objective.Add(MakeInverseDepthTerm({1000.0, 0.003, kFrames}));
  ShapeMemory memory;
  const auto evaluate = [&](const Variables& at) {
    return objective.Evaluate(at, scene.visibility, {Want::Order::kNormalMatrix}, 1, &memory);
  };
  const Evaluation before = evaluate(start);
  Variables moved = start;
  moved.style[0] += 0.1;
  fails = true;
  const Evaluation failed = evaluate(moved);
  Check("a prior that fails", !failed.ok() && failed.failure == "the prior says no", failed.failure);
  fails = false;
  Check("the evaluation after it", evaluate(moved).ok() && SameBytes(before, evaluate(start)),
        "the same bytes");

  Variables behind = start;
  behind.camera_from_object[2].translation.z() = -1.0;
  Check("a shape behind a camera", evaluate(behind).failure == kBehindCamera, evaluate(behind).failure);

  for (const EvaluationKind kind : {EvaluationKind::kAccumulated, EvaluationKind::kBlocks}) {
    const std::string name = kind == EvaluationKind::kBlocks ? "blocks: " : "accumulated: ";
    MinimiseOptions options;
    options.evaluation = kind;
    const auto minimise = [&](Variables from, const IterationObserver& observer) {
      ShapeMemory fresh;
      Minimise(objective, scene.visibility, Free{}, 1, options, observer, &fresh, &from);
      return from;
    };
    const auto message = [&](const Variables& from, const IterationObserver& observer) -> std::string {
      try {
        minimise(from, observer);
      } catch (const std::exception& error) {
        return error.what();
      }
      return "nothing";
    };
    // Every evaluation but the first few fails: the steps are not taken, and the solve ends where it stood.
    int left = 0;
    const auto observer = [&](const IterationState&) {
      fails = --left <= 0;
      return true;
    };
    left = 3;
    const std::string late = message(start, observer);
    fails = false;
    Check(name + "a prior that fails in the middle", late == "nothing", late);
    fails = true;
    const std::string early = message(start, [](const IterationState&) { return true; });
    fails = false;
    Check(name + "a prior that fails at the start", early == "the prior says no", early);
    const std::string back = message(behind, [](const IterationState&) { return true; });
    Check(name + "a start behind a camera", back == kBehindCamera, back);
    const std::string thrown =
        message(start, [](const IterationState&) -> bool { throw std::runtime_error("stop"); });
    Check(name + "an observer that throws", thrown == "stop", thrown);
  }
}

// The paper's p0 moves all frames, dp_l one: Eq. 2-3 with finite motions.
void CheckComposition(const Variables& start) {
  const int target = 1;
  const Pose& p0 = start.camera_from_object[target];
  Coordinates together(start, {PoseMotion::kTogether, false, false, false}, target);
  std::vector<double> values = together.values();
  const double twist[6] = {0.4, -0.9, 0.3, 0.1, -0.2, 0.5};
  std::copy(twist, twist + 6, values.begin());
  together.SetValues(values);
  const Variables moved = together.Current();
  const Pose moved_p0 = Twisted(p0, twist);
  double difference = 0.0;
  for (int l = 0; l < kFrames; ++l) {
    const Pose& pose = start.camera_from_object[static_cast<size_t>(l)];
    const Matrix3 relative = pose.rotation * p0.rotation.transpose();
    const Vector3 shift = pose.translation - p0.translation;
    const Pose& found = moved.camera_from_object[static_cast<size_t>(l)];
    difference = std::max(difference, (found.rotation - relative * moved_p0.rotation).norm());
    difference = std::max(difference, (found.translation - (shift + moved_p0.translation)).norm());
  }
  Check("moving p0 keeps every dp_l", difference < 1e-12, std::to_string(difference));
}

}  // namespace

int main() {
  // Ceres logs the failures that are meant.
  FLAGS_minloglevel = google::GLOG_FATAL;
  const Scene scene;
  const Free every{PoseMotion::kEach, true, true, true};
  for (const auto& [angle, seed] : {std::pair{0.9, 1u}, {0.0, 2u}, {1e-9, 3u}, {kPi - 1e-7, 4u}, {kPi, 5u}}) {
    const Variables start = Start(angle, seed);
    for (const Case& one : Cases(scene, start)) {
      CompareAt(one.name, *one.objective, scene.visibility, start, every, 0.0, true);
      CompareAt(one.name + ", moved", *one.objective, scene.visibility, start, every, 0.02, seed == 1);
    }
  }
  const Variables start = Start(0.9, 1);
  const std::vector<Case> cases = Cases(scene, start);
  const Objective& all = *cases.back().objective;
  for (const PoseMotion poses : {PoseMotion::kTogether, PoseMotion::kSources, PoseMotion::kHeld}) {
    const std::string name = "poses " + std::to_string(static_cast<int>(poses));
    CompareAt(name, all, scene.visibility, start, {poses, true, true, true}, 0.03, true);
    CompareAt(name + " alone", all, scene.visibility, start,
              {poses, poses == PoseMotion::kHeld, false, false}, 0.03, true);
  }
  for (const Case& one : cases) {
    // The others have no freedom to speak of, or end at once.
    if (one.name == "all terms" || one.name == "photometric" ||
        one.name == "silhouette, Cauchy and tolerance" || one.name == "photometric, all in the tail") {
      CompareCourses(one.name + ", Levenberg-Marquardt", *one.objective, scene.visibility, start, Free{},
                     false);
    }
  }
  CompareCourses("all terms with focal, Levenberg-Marquardt", all, scene.visibility, start, every, false);
  CompareCourses("all terms, p0, Levenberg-Marquardt", all, scene.visibility, start,
                 {PoseMotion::kTogether, false, true, false}, false);
  CompareCourses("all terms, L-BFGS", all, scene.visibility, start, Free{}, true);

  ShapeMemory memory;
  const auto with_threads = [&](int threads) {
    return all.Evaluate(start, scene.visibility, {Want::Order::kNormalMatrix}, threads, &memory);
  };
  Check("threads", SameBytes(with_threads(1), with_threads(2)) && SameBytes(with_threads(1), with_threads(7)),
        "the same bytes with 1, 2 and 7");
  CheckFailures(scene, start);
  CheckComposition(start);
  return Failures();
}
