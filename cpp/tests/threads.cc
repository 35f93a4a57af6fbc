// Evaluations and solves on several threads, and solves at once over the same footage, give the bytes of one
// thread; for ThreadSanitizer to watch. Prints one line per check; exits with the number of failures.
#include <cstdio>
#include <cstring>
#include <string>
#include <thread>
#include <vector>

#include "core/minimise.h"
#include "tests/scene.h"

namespace {

using namespace spba;
using namespace spba::test;

constexpr int kThreads = 4;

// A few iterations of Levenberg-Marquardt: the costs by term of each, then the variables at the end.
std::vector<double> Solve(const Objective& objective, const Visibility& visibility, Variables variables,
                          EvaluationKind kind, int threads) {
  MinimiseOptions options;
  options.evaluation = kind;
  options.max_iterations = 4;
  options.tolerance = 0.0;
  options.threads = threads;
  std::vector<double> found;
  const auto observer = [&](const IterationState& state) {
    found.insert(found.end(), state.costs.begin(), state.costs.end());
    return true;
  };
  ShapeMemory memory;
  Minimise(objective, visibility, Free{PoseMotion::kEach, true, true, true}, 1, options, observer, &memory,
           &variables);
  for (const Pose& pose : variables.camera_from_object) {
    found.insert(found.end(), pose.rotation.data(), pose.rotation.data() + 9);
    found.insert(found.end(), pose.translation.data(), pose.translation.data() + 3);
  }
  found.insert(found.end(), variables.style.begin(), variables.style.end());
  found.push_back(variables.log_alpha);
  found.push_back(variables.log_focal);
  return found;
}

bool SameBytes(const std::vector<double>& a, const std::vector<double>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), sizeof(double) * a.size()) == 0;
}

}  // namespace

int main() {
  const Scene scene;
  const Variables start = Start(0.9, 1);
  Objective objective(scene.footage, Ball(true), false);
  AddAllTerms(scene, start, &objective);
  for (const Want::Order order : {Want::Order::kCost, Want::Order::kGradient, Want::Order::kNormalMatrix}) {
    ShapeMemory memory;
    const auto evaluate = [&](int threads) {
      return objective.Evaluate(start, scene.visibility, {order}, threads, &memory);
    };
    const Evaluation one = evaluate(1);
    Check("evaluation " + std::to_string(static_cast<int>(order)),
          one.ok() && test::SameBytes(one, evaluate(kThreads)), "cost " + std::to_string(one.Cost()));
  }
  for (const EvaluationKind kind : {EvaluationKind::kAccumulated, EvaluationKind::kBlocks}) {
    const std::string name = kind == EvaluationKind::kBlocks ? "blocks" : "accumulated";
    const auto solve = [&](const Objective& of, int threads) {
      return Solve(of, scene.visibility, start, kind, threads);
    };
    const std::vector<double> alone = solve(objective, 1);
    Check(name + ", threads", SameBytes(alone, solve(objective, kThreads)),
          std::to_string(alone.size()) + " numbers");
    std::vector<double> at_once[2];
    std::vector<std::thread> solves;
    for (std::vector<double>& found : at_once) {
      solves.emplace_back([&] {
        Objective own(scene.footage, Ball(true), false);
        AddAllTerms(scene, start, &own);
        found = solve(own, kThreads);
      });
    }
    for (std::thread& thread : solves) thread.join();
    Check(name + ", two at once", SameBytes(alone, at_once[0]) && SameBytes(alone, at_once[1]),
          "the same bytes");
  }
  return Failures();
}
