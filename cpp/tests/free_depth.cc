// The fast blocks of photometric bundle adjustment against their functor, at random and at awkward points:
// cost, gradient and J^T J. The cost of a pixel by itself against the functor's loss, and depths that it
// finds. Prints what differs; exits with the number of failures.
#include "core/free_depth.h"

#include <ceres/loss_function.h>

#include <cmath>
#include <cstdio>
#include <deque>
#include <memory>
#include <random>
#include <vector>

#include "core/pixel_depth.h"

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

// How far the cost of a pixel by itself, and its derivative, are from those of the functor under its loss.
double PixelDifference(const ceres::CostFunction& functor, const spba::FreeDepthCameras& cameras,
                       const Point& point, double loss_width) {
  const spba::FreeDepthPixel pixel{0, point.x, point.y, point.inverse_depth, {1}};
  const spba::PixelDepthCost cost(cameras, pixel, loss_width);
  double residuals[2], jacobian[2], alone[2];
  const bool valid = cost(&point.inverse_depth, residuals, jacobian);
  if (valid != cost(&point.inverse_depth, alone, nullptr)) return HUGE_VAL;
  Eigen::VectorXd expected(functor.num_residuals()), by_depth(functor.num_residuals());
  const double* parameters[] = {point.twists, point.twists + 6, &point.inverse_depth};
  double* jacobians[] = {nullptr, nullptr, by_depth.data()};
  if (valid != functor.Evaluate(parameters, expected.data(), jacobians)) return HUGE_VAL;
  if (!valid) return residuals[0] > 1e50 && alone[0] > 1e50 ? 0.0 : HUGE_VAL;
  const ceres::HuberLoss loss(loss_width * std::sqrt(expected.size()));
  double rho[3];
  loss.Evaluate(expected.squaredNorm(), rho);
  const double squares = residuals[0] * residuals[0] + residuals[1] * residuals[1];
  const double gradient = residuals[0] * jacobian[0] + residuals[1] * jacobian[1];
  const double size = std::max(rho[0], 1e-12), steepness = std::max(by_depth.norm(), 1e-12);
  return std::max({std::abs(squares - rho[0]) / size,
                   std::abs(alone[0] * alone[0] + alone[1] * alone[1] - rho[0]) / size,
                   std::abs(gradient - rho[1] * by_depth.dot(expected)) / (std::sqrt(size) * steepness)});
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

// How many of the pixels of a plane, started a few percent off, are not found where they are; what no source
// can see must stay where it is, and be judged so.
int DepthsMissed() {
  const double depth = 2.0, shift = 0.1;
  std::vector<float> target, source;
  for (int row = 0; row < kHeight; ++row) {
    for (int column = 0; column < kWidth; ++column) {
      for (int channel = 0; channel < 3; ++channel) {
        const auto seen = [&](double moved) {
          const double x = (column + 0.5 - kCamera.cx) / kCamera.fx * depth + moved;
          return static_cast<float>(128 + 60 * std::sin(9.0 * x + channel) + 40 * std::sin(0.3 * row));
        };
        target.push_back(seen(0.0));
        source.push_back(seen(shift));
      }
    }
  }
  std::deque<spba::ImageSampler> images;
  for (const auto* rgb : {&target, &source}) images.emplace_back(rgb->data(), kWidth, kHeight);
  const std::vector<double> twists = {0, 0, 0, 0, 0, 0, 0, 0, 0, -shift, 0, 0};
  std::vector<spba::FreeDepthPixel> pixels;
  for (int column = 14; column < 50; column += 4) {
    pixels.push_back({0, column + 0.5, 24.5, (1.0 + 0.002 * (column - 32)) / depth, {1}});
  }
  pixels.push_back({0, 32.5, 24.5, -1.0, {1}});
  spba::AdjustPixelDepths(twists, pixels, images, {kCamera, 10.0, 10});
  const spba::FreeDepthPixel behind = pixels.back();
  pixels.pop_back();
  int missed = behind.inverse_depth != -1.0 || std::isfinite(behind.deviation);
  for (const spba::FreeDepthPixel& pixel : pixels) {
    const double off = pixel.inverse_depth * depth - 1.0;
    if (std::abs(off) < 1e-4 && pixel.error < 0.1 && pixel.deviation < 0.03) continue;
    std::fprintf(stderr, "depth at %g: off by %g, error %g, deviation %g\n", pixel.x, off, pixel.error,
                 pixel.deviation);
    ++missed;
  }
  return missed;
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
    // Within the loss's width, beyond it, and without any.
    for (const double loss_width : {10.0, 0.3, 1e6}) {
      fails = fails || !(PixelDifference(*cost, cameras, point, loss_width) < 1e-9);
    }
    if (fails) {
      ++failures;
      std::fprintf(stderr, "pixel %g %g at %g, turned by %g: %d and %d, off by %g\n", point.x, point.y,
                   point.inverse_depth, spba::Vector3(point.twists).norm(), expected.valid, found.valid,
                   expected.valid && found.valid ? Difference(expected, found) : HUGE_VAL);
    }
  }
  failures += DepthsMissed();
  std::printf("worst %g, %d invalid, %d failures\n", worst, invalid, failures);
  return failures;
}
