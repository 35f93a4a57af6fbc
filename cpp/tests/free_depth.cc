// The fast blocks of photometric bundle adjustment against their functor, at random and at awkward points:
// cost, gradient and J^T J. Prints what differs; exits with the number of failures.
#include "core/free_depth.h"

#include <cmath>
#include <cstdio>
#include <deque>
#include <memory>
#include <random>
#include <vector>

namespace {

constexpr int kWidth = 64, kHeight = 48;
constexpr int kParameters = 13;
constexpr double kPi = 3.14159265358979323846;
const spba::Pinhole kCamera{70.0, 72.0, 31.0, 25.0};

// Camera_from_world of target and source, inverse depth, and the pixel.
struct Point {
  double twists[12];
  double inverse_depth;
  double x, y;
};

// What a least-squares solver makes of a residual block.
struct Sums {
  // With Jacobians, and of the residuals alone.
  bool valid = false, valid_alone = false;
  double squares = 0.0, squares_alone = 0.0;
  Eigen::VectorXd gradient;
  Eigen::MatrixXd product;
};

Sums SumsOf(const ceres::CostFunction& cost, const Point& point) {
  const double* parameters[] = {point.twists, point.twists + 6, &point.inverse_depth};
  const int count = cost.num_residuals();
  Eigen::VectorXd alone(count), residuals(count);
  spba::RowMajorMatrix blocks[] = {spba::RowMajorMatrix(count, 6), spba::RowMajorMatrix(count, 6),
                                   spba::RowMajorMatrix(count, 1)};
  double* jacobians[] = {blocks[0].data(), blocks[1].data(), blocks[2].data()};
  Sums sums;
  sums.valid = cost.Evaluate(parameters, residuals.data(), jacobians);
  sums.valid_alone = cost.Evaluate(parameters, alone.data(), nullptr);
  if (!sums.valid) return sums;
  Eigen::MatrixXd jacobian(count, kParameters);
  jacobian << blocks[0], blocks[1], blocks[2];
  sums.squares = residuals.squaredNorm();
  sums.squares_alone = alone.squaredNorm();
  sums.gradient = jacobian.transpose() * residuals;
  sums.product = jacobian.transpose() * jacobian;
  return sums;
}

// The derivative by the depth when the cameras are held, as its square and its product with the residuals.
Eigen::Vector2d ByDepth(const ceres::CostFunction& cost, const Point& point) {
  const double* parameters[] = {point.twists, point.twists + 6, &point.inverse_depth};
  Eigen::VectorXd residuals(cost.num_residuals()), by_depth(cost.num_residuals());
  double* jacobians[] = {nullptr, nullptr, by_depth.data()};
  cost.Evaluate(parameters, residuals.data(), jacobians);
  return {by_depth.squaredNorm(), by_depth.dot(residuals)};
}

// The largest difference, against what the entries could be at most by the diagonal of J^T J and the cost.
double Difference(const Sums& a, const Sums& b) {
  const double squares = std::max(a.squares, 1e-12);
  double worst = std::max(std::abs(a.squares - b.squares), std::abs(a.squares - b.squares_alone)) / squares;
  for (int i = 0; i < kParameters; ++i) {
    const double size = std::max(a.product(i, i), 1e-12);
    worst = std::max(worst, std::abs(a.gradient[i] - b.gradient[i]) / std::sqrt(size * squares));
    for (int j = 0; j < kParameters; ++j) {
      const double other = std::max(a.product(j, j), 1e-12);
      worst = std::max(worst, std::abs(a.product(i, j) - b.product(i, j)) / std::sqrt(size * other));
    }
  }
  return worst;
}

std::vector<float> Texture(double phase) {
  std::vector<float> rgb;
  for (int row = 0; row < kHeight; ++row) {
    for (int column = 0; column < kWidth; ++column) {
      for (int channel = 0; channel < 3; ++channel) {
        rgb.push_back(
            static_cast<float>(128 + 100 * std::sin(0.41 * column + 0.37 * row * (channel + 1) + phase)));
      }
    }
  }
  return rgb;
}

// One as they come, turned by so much; the source turns and moves a little against the target.
Point Random(double angle, std::mt19937& random) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  spba::Vector3 axis(unit(random), unit(random), unit(random));
  axis.normalize();
  Point point{};
  for (int i = 0; i < 3; ++i) {
    point.twists[i] = angle * axis[i];
    point.twists[3 + i] = 0.3 * unit(random) + (i == 2 ? 2.0 : 0.0);
    point.twists[6 + i] = point.twists[i] + (angle == 0.0 ? 0.0 : 0.02 * angle * unit(random));
    point.twists[9 + i] = point.twists[3 + i] + 0.1 * unit(random);
  }
  point.inverse_depth = 0.6 + 0.2 * unit(random);
  point.x = 32.0 + 20.0 * unit(random);
  point.y = 24.0 + 15.0 * unit(random);
  return point;
}

std::vector<Point> Points() {
  std::mt19937 random(7);
  std::vector<Point> points;
  // Between 1e-12 and 1e-5 the functor's own derivative is off by up to 1e-8: AngleAxisRotatePoint is linear
  // in the smallest angles, and loses digits of the cosine in small ones.
  for (const double angle : {0.0, 1e-12, 1e-5, 1e-3, 1.1e-3, 0.7, 3.0, kPi - 1e-6, kPi, kPi + 0.1}) {
    for (int i = 0; i < 20; ++i) points.push_back(Random(angle, random));
  }
  // On the image's border and beyond it, in the target or in the source.
  for (const double x : {-3.0, 0.0, 0.5, 63.5, 64.0, 70.0}) {
    Point point = Random(0.4, random);
    point.x = x;
    points.push_back(point);
    point.x = 32.0;
    point.twists[9] += (x - 32.0) / kCamera.fx / point.inverse_depth;
    points.push_back(point);
  }
  // No depth, a negative one, in the target's camera plane, and behind the source.
  for (const double inverse_depth : {0.0, -0.5, 1e4, 2e4, 1e308}) {
    Point point = Random(0.4, random);
    point.inverse_depth = inverse_depth;
    points.push_back(point);
  }
  Point behind = Random(0.4, random);
  behind.twists[11] -= 3.0 / behind.inverse_depth;
  points.push_back(behind);
  return points;
}

}  // namespace

int main() {
  const std::vector<float> rgb[] = {Texture(0.0), Texture(1.0)};
  std::deque<spba::ImageSampler> images;
  for (const auto& image : rgb) images.emplace_back(image.data(), kWidth, kHeight);
  int failures = 0, invalid = 0;
  double worst = 0.0;
  for (const Point& point : Points()) {
    const std::unique_ptr<ceres::CostFunction> cost(
        spba::FreeDepthCost::Create({kCamera, kCamera, &images[0], &images[1]}, point.x, point.y));
    const spba::FreeDepthCameras cameras(kCamera, point.twists, images);
    const spba::FreeDepthBlock block(cameras, spba::FreeDepthPatch(cameras, 0, point.x, point.y), 1);
    const Sums expected = SumsOf(*cost, point), found = SumsOf(block, point);
    bool fails = expected.valid != found.valid || expected.valid != found.valid_alone;
    if (expected.valid && found.valid) {
      const double difference = Difference(expected, found);
      const Eigen::Vector2d by_depth = ByDepth(*cost, point), fast = ByDepth(block, point);
      worst = std::max(worst, difference);
      fails = !(difference < 1e-9) || !((by_depth - fast).norm() <= 1e-9 * by_depth.norm());
    } else {
      ++invalid;
    }
    if (fails) {
      ++failures;
      std::fprintf(stderr, "pixel %g %g at %g, turned by %g: %d and %d, off by %g\n", point.x, point.y,
                   point.inverse_depth, spba::Vector3(point.twists).norm(), expected.valid, found.valid,
                   expected.valid && found.valid ? Difference(expected, found) : HUGE_VAL);
    }
  }
  std::printf("worst %g, %d invalid, %d failures\n", worst, invalid, failures);
  return failures;
}
