// The fast blocks of classic bundle adjustment against their functor, at random and at awkward points:
// residuals and derivatives. Prints what differs; exits with the number of failures.
#include <cmath>
#include <cstdio>
#include <memory>
#include <random>
#include <vector>

#include "core/reprojection_block.h"
#include "spba/reprojection.h"

namespace {

constexpr double kPi = 3.14159265358979323846;
const spba::Pinhole kCamera{70.0, 72.0, 31.0, 25.0};
const spba::Vector2 kPixel(30.5, 20.5);

struct Point {
  // Of another camera, and of the one that sees the point.
  double twists[12];
  double position[3];
  double zoom;
};

struct Values {
  bool valid = false, valid_alone = false;
  Eigen::Vector2d residual, alone;
  // By pose, position and zoom.
  Eigen::Matrix<double, 2, 10> jacobian;
};

Values ValuesOf(const ceres::CostFunction& cost, const Point& point) {
  const double* parameters[] = {point.twists + 6, point.position, &point.zoom};
  spba::RowMajorMatrix blocks[] = {spba::RowMajorMatrix(2, 6), spba::RowMajorMatrix(2, 3),
                                   spba::RowMajorMatrix(2, 1)};
  double* jacobians[] = {blocks[0].data(), blocks[1].data(), blocks[2].data()};
  Values values;
  values.valid = cost.Evaluate(parameters, values.residual.data(), jacobians);
  values.valid_alone = cost.Evaluate(parameters, values.alone.data(), nullptr);
  values.jacobian << blocks[0], blocks[1], blocks[2];
  return values;
}

// Against the largest entry of either block.
double Difference(const Values& a, const Values& b) {
  const double by_residual = (a.residual - b.residual).norm() + (a.residual - b.alone).norm();
  return by_residual / std::max(a.residual.norm(), 1.0) +
         (a.jacobian - b.jacobian).norm() / a.jacobian.norm();
}

std::vector<Point> Points() {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  std::vector<Point> points;
  const auto add = [&](double angle, double distance) {
    Point point{};
    spba::Vector3 axis(unit(random), unit(random), unit(random));
    axis.normalize();
    for (int i = 0; i < 3; ++i) {
      point.twists[i] = unit(random);
      point.twists[6 + i] = angle * axis[i];
      point.twists[9 + i] = 0.3 * unit(random) + (i == 2 ? distance : 0.0);
      point.position[i] = unit(random);
    }
    point.zoom = 1.0 + 0.3 * unit(random);
    points.push_back(point);
  };
  // Not between 1e-12 and 1e-5, where the functor's own derivative has fewer digits (see free_depth.cc).
  for (const double angle : {0.0, 1e-12, 1e-5, 1e-3, 0.7, 3.0, kPi - 1e-6, kPi, kPi + 0.1}) {
    for (int i = 0; i < 20; ++i) add(angle, 3.0);
  }
  // Near the camera, in its plane and behind it.
  for (const double distance : {1.0, 0.5, 0.0, -0.5, -3.0}) {
    for (int i = 0; i < 20; ++i) add(0.4, distance);
  }
  return points;
}

}  // namespace

int main() {
  const std::unique_ptr<ceres::CostFunction> functor(
      spba::Reprojection::Create(kCamera, kPixel[0], kPixel[1]));
  int failures = 0, invalid = 0;
  double worst = 0.0;
  for (const Point& point : Points()) {
    const spba::PosedCameras cameras(point.twists, 2);
    const spba::ReprojectionBlock block(cameras, 1, kCamera, kPixel);
    const Values expected = ValuesOf(*functor, point), found = ValuesOf(block, point);
    bool fails = expected.valid != found.valid || expected.valid != found.valid_alone;
    if (expected.valid && found.valid) {
      const double difference = Difference(expected, found);
      worst = std::max(worst, difference);
      fails = !(difference < 1e-9);
    } else {
      ++invalid;
    }
    if (fails) {
      ++failures;
      std::fprintf(stderr, "turned by %g: %d and %d, off by %g\n", spba::Vector3(point.twists + 6).norm(),
                   expected.valid, found.valid, Difference(expected, found));
    }
  }
  std::printf("worst %g, %d invalid, %d failures\n", worst, invalid, failures);
  return failures + (invalid == 0);
}
