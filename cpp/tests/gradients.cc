// Every cost functor of include/spba against numeric differences, at random and at awkward points.
// Prints one line per functor; exits with the number of failures.
#include <ceres/gradient_checker.h>

#include <cmath>
#include <cstdio>
#include <random>
#include <string>
#include <vector>

#include "spba/inverse_depth.h"
#include "spba/motion.h"
#include "spba/photometric.h"
#include "spba/reprojection.h"
#include "spba/silhouette.h"

namespace {

constexpr int kWidth = 64, kHeight = 48;
constexpr double kPi = 3.14159265358979323846;
const double kAlpha = 0.9;
const spba::Pinhole kCamera{70.0, 72.0, 31.0, 25.0};

std::vector<float> SmoothImage(double phase) {
  std::vector<float> rgb;
  for (int row = 0; row < kHeight; ++row) {
    for (int column = 0; column < kWidth; ++column) {
      for (int channel = 0; channel < 3; ++channel) {
        rgb.push_back(
            static_cast<float>(128 + 100 * std::sin(0.21 * column + 0.17 * row * (channel + 1) + phase)));
      }
    }
  }
  return rgb;
}

// p0, dp and x such that both cameras see the point in front of them; another pose near p0.
struct Point {
  double p0[6], motion[6], x[3], other[6];
};

std::vector<Point> Points() {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  std::vector<Point> points;
  const double angles[] = {0.0, 1e-9, 1e-3, 0.7, kPi - 1e-6, kPi, 3.0};
  for (const double angle : angles) {
    for (const double motion_angle : {0.0, 1e-8, 0.4, kPi - 1e-6}) {
      Point point;
      double axis[3] = {unit(random), unit(random), unit(random)};
      const double norm = std::sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]);
      for (int i = 0; i < 3; ++i) {
        point.p0[i] = angle * axis[i] / norm;
        point.motion[i] = motion_angle * axis[(i + 1) % 3] / norm;
        point.p0[3 + i] = 0.1 * unit(random) + (i == 2 ? 2.0 : 0.0);
        point.motion[3 + i] = 0.1 * unit(random);
        point.x[i] = 0.4 * unit(random);
        point.other[i] = point.p0[i] + 0.02 * unit(random);
        point.other[3 + i] = point.p0[3 + i] + 0.1 * unit(random);
      }
      points.push_back(point);
    }
  }
  // On the image's border and beyond it, where sampling must stay differentiable.
  for (const double side : {-0.886, 0.943, -3.0, 3.0}) {
    points.push_back(
        {{0, 0, 0, 0, 0, 2.0}, {0, 0.01, 0, 0.01, 0, 0}, {side, 0.1, 0.0}, {0, 0, 0.01, side, 0, 2.0}});
  }
  return points;
}

// A cost's parameters out of a point.
using Parameters = std::vector<const double*> (*)(const Point&);

std::vector<const double*> OfPair(const Point& point) { return {point.p0, point.motion, point.x, &kAlpha}; }
std::vector<const double*> OfOneView(const Point& point) { return {point.p0, point.x, &kAlpha}; }
std::vector<const double*> OfFreeDepth(const Point& point) { return {point.p0, point.other, &kAlpha}; }
std::vector<const double*> OfMotion(const Point& point) { return {point.p0, point.motion, &kAlpha}; }
std::vector<const double*> OfZoom(const Point&) { return {&kAlpha}; }
std::vector<const double*> OfPose(const Point& point) { return {point.p0}; }

int Check(const std::string& name, const ceres::CostFunction& cost, const std::vector<Point>& points,
          Parameters parameters_of) {
  ceres::NumericDiffOptions options;
  // Small: bicubic sampling has kinks in its second derivative, at which an error grows with the step.
  options.ridders_relative_initial_step_size = 1e-6;
  const std::vector<const ceres::Manifold*>* no_manifolds = nullptr;
  const ceres::GradientChecker checker(&cost, no_manifolds, options);
  int failures = 0;
  for (const Point& point : points) {
    const auto parameters = parameters_of(point);
    ceres::GradientChecker::ProbeResults results;
    checker.Probe(parameters.data(), 1e-5, &results);
    // Against the largest entry of all blocks: an entry that is nearly zero has no digits to compare.
    // The kinks leave up to 1e-5 of it, rounding 1e-8.
    double largest = 0.0, difference = results.return_value ? 0.0 : 1e300;
    for (size_t block = 0; block < results.jacobians.size(); ++block) {
      largest = std::max(largest, results.numeric_jacobians[block].cwiseAbs().maxCoeff());
      difference = std::max(
          difference, (results.jacobians[block] - results.numeric_jacobians[block]).cwiseAbs().maxCoeff());
    }
    if (!(difference <= 2e-5 * std::max(largest, 1e-3))) {
      ++failures;
      std::fprintf(stderr, "%s: off by %g of %g\n", name.c_str(), difference, largest);
    }
  }
  std::printf("%s: %zu points, %d failures\n", name.c_str(), points.size(), failures);
  return failures;
}

int CheckBehind(const std::string& name, const ceres::CostFunction& cost, Parameters parameters_of) {
  const Point behind{{0, 0, 0, 0, 0, -2.0}, {0, 0, 0, 0, 0, 0}, {0.1, 0.1, 0.1}, {0, kPi, 0, 0, 0, -4.0}};
  const Point on_plane{{0, 0, 0, 0, 0, 0}, {0, 0, 0, 0, 0, 0}, {0.1, 0.1, 0.0}, {0, kPi, 0, 0, 0, 0}};
  int failures = 0;
  for (const Point& point : {behind, on_plane}) {
    const auto parameters = parameters_of(point);
    std::vector<double> residuals(static_cast<std::size_t>(cost.num_residuals()));
    if (cost.Evaluate(parameters.data(), residuals.data(), nullptr)) ++failures;
  }
  std::printf("%s behind the camera: %d failures\n", name.c_str(), failures);
  return failures;
}

}  // namespace

int main() {
  const std::vector<float> target = SmoothImage(0.0), source = SmoothImage(1.0);
  const spba::ImageSampler target_image(target.data(), kWidth, kHeight);
  const spba::ImageSampler source_image(source.data(), kWidth, kHeight);
  using Cost = std::unique_ptr<ceres::CostFunction>;
  struct {
    const char* name;
    Cost cost;
    Parameters parameters_of;
  } const cases[] = {
      {"photometric", Cost(spba::PhotometricCost::Create({kCamera, kCamera, &target_image, &source_image})),
       OfPair},
      {"free depth",
       Cost(spba::FreeDepthCost::Create({kCamera, kCamera, &target_image, &source_image}, 30.5, 20.5)),
       OfFreeDepth},
      {"silhouette", Cost(spba::SilhouetteCost::Create({kCamera, {30.5, 20.5}, 1.0})), OfPair},
      {"inverse depth", Cost(spba::InverseDepthCost::Create({kCamera, {30.5, 20.5}, 0.4, {0.003, -0.002}})),
       OfPair},
      {"reprojection", Cost(spba::Reprojection::Create(kCamera, 30.5, 20.5)), OfOneView},
  };
  int failures = Check("zoom prior", *Cost(spba::ZoomPrior::Create(0.05)), Points(), OfZoom);
  const double from_point[3] = {0.3, -0.4, 0.2};
  failures += Check("distance prior", *Cost(spba::DistancePrior::Create(from_point, 1.7)), Points(), OfPose);
  const spba::MotionError motion{{0.36, 0.48, -0.8, -0.8, 0.6, 0, 0.48, 0.64, 0.6}, {0.3, -0.2, 0.1}};
  failures += Check("motion", *Cost(spba::MotionCost::Create(motion)), Points(), OfMotion);
  for (const auto& [name, cost, parameters_of] : cases) {
    failures += Check(name, *cost, Points(), parameters_of);
    failures += CheckBehind(name, *cost, parameters_of);
  }
  return failures;
}
