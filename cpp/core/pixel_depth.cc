#include "core/pixel_depth.h"

#include <ceres/jet.h>
#include <ceres/tiny_solver.h>

#include <cmath>
#include <stdexcept>

namespace spba {
namespace {

constexpr int kPatch = FreeDepthCost::kPatch;
constexpr int kColours = 3 * kPatch;

using Colours = FreeDepthPatch::Colours;
using Jet = ceres::Jet<double, 1>;

// More than any cost, and its square is finite.
constexpr double kHuge = 1e100;
// A step by less than this share of the inverse depth ends the search: a hundredth of what a good depth is
// known to.
constexpr double kSmallestStep = 1e-5;
// Less than this in the sum of squares, of colours from 0 to 255, is nothing.
constexpr double kSmallestGain = 1e-3;

// What a patch looks like in a source, less its mean, and the derivative by the inverse depth if asked for.
// False behind the camera.
bool Look(const Vector3 (&directions)[kPatch], const Vector3& target_in_source, const PointColour& colour,
          double inverse_depth, Colours& colours, Colours* by_inverse_depth) {
  const double depth = 1.0 / inverse_depth;
  for (int k = 0; k < kPatch; ++k) {
    const Vector3 in_source = depth * directions[k] + target_in_source;
    if (by_inverse_depth == nullptr) {
      if (!colour(in_source.data(), colours.data() + 3 * k)) return false;
      continue;
    }
    Jet point[3], rgb[3];
    for (int i = 0; i < 3; ++i) {
      point[i] = Jet(in_source[i]);
      point[i].v[0] = -depth * depth * directions[k][i];
    }
    if (!colour(point, rgb)) return false;
    for (int channel = 0; channel < 3; ++channel) {
      colours[3 * k + channel] = rgb[channel].a;
      (*by_inverse_depth)[3 * k + channel] = rgb[channel].v[0];
    }
  }
  SubtractPatchMean(colours);
  if (by_inverse_depth != nullptr) SubtractPatchMean(*by_inverse_depth);
  return true;
}

}  // namespace

PixelDepthCost::PixelDepthCost(const FreeDepthCameras& cameras, const FreeDepthPixel& pixel,
                               double loss_width)
    : camera_(cameras.intrinsics()),
      patch_(cameras, pixel.target, pixel.x, pixel.y),
      squared_width_(loss_width * loss_width * kColours) {
  const Pose& target = cameras.posed(pixel.target).camera_from_world;
  for (const std::uint32_t index : pixel.sources) {
    const Pose& source = cameras.posed(index).camera_from_world;
    const Matrix3 turn = source.rotation * target.rotation.transpose();
    sources_.push_back({&cameras.image(index), turn, source.translation - turn * target.translation});
  }
}

bool PixelDepthCost::operator()(const double* inverse_depth, double* residuals, double* jacobian) const {
  Eigen::Map<Eigen::VectorXd> all(residuals, NumResiduals());
  all.setConstant(kHuge);
  if (!(inverse_depth[0] > 0.0 && 1.0 / inverse_depth[0] > kMinDepth)) return false;
  if (jacobian != nullptr) squares_ = information_ = 0.0;
  for (const Source& source : sources_) {
    Vector3 directions[kPatch];
    for (int k = 0; k < kPatch; ++k) {
      directions[k] = source.source_from_target * PatchRay(camera_, patch_.x, patch_.y, k);
    }
    Colours colours, slope;
    if (!Look(directions, source.target_in_source, {camera_, source.image}, inverse_depth[0], colours,
              jacobian == nullptr ? nullptr : &slope)) {
      all.setConstant(kHuge);
      return false;
    }
    const Colours difference = patch_.colours - colours;
    const double squares = difference.squaredNorm();
    // Huber's loss, as a factor of the squares; and of the residuals, with its derivative by the squares.
    const bool in_tail = squares > squared_width_;
    const double loss = in_tail ? 2.0 * std::sqrt(squared_width_ * squares) - squared_width_ : squares;
    const double factor = in_tail ? std::sqrt(loss / squares) : 1.0;
    if (jacobian == nullptr) {
      residuals[0] = factor * std::sqrt(squares);
      residuals[1] = 0.0;
    } else {
      const double steepness = slope.norm();
      const double along = steepness > 0.0 ? -difference.dot(slope) / steepness : 0.0;
      const double across = std::sqrt(std::max(squares - along * along, 0.0));
      residuals[0] = factor * along;
      residuals[1] = factor * across;
      jacobian[0] = factor * steepness;
      jacobian[1] = 0.0;
      if (in_tail) {
        const double by_squares =
            0.5 / factor * (std::sqrt(squared_width_ / squares) - loss / squares) / squares;
        const double bend = by_squares * 2.0 * along * steepness;
        jacobian[0] += along * bend;
        jacobian[1] += across * bend;
      }
      jacobian += 2;
      squares_ += squares;
      information_ += slope.squaredNorm();
    }
    residuals += 2;
  }
  return true;
}

void PixelDepthCost::Judge(FreeDepthPixel& pixel) const {
  pixel.error = std::sqrt(squares_ / static_cast<double>(kColours * sources_.size()));
  pixel.deviation = information_ > 0.0 ? 1.0 / std::sqrt(information_) : HUGE_VAL;
}

void AdjustPixelDepths(const std::vector<double>& twists, std::vector<FreeDepthPixel>& pixels,
                       const std::deque<ImageSampler>& images, const FreeDepthOptions& options) {
  CheckCameras(twists, pixels, images);
  const FreeDepthCameras cameras(options.intrinsics, twists.data(), images);
  ceres::TinySolver<PixelDepthCost> solver;
  solver.options.max_num_iterations = options.max_iterations;
  solver.options.parameter_tolerance = kSmallestStep;
  solver.options.function_tolerance = kSmallestGain;
  Eigen::VectorXd residuals, jacobian;
  for (FreeDepthPixel& pixel : pixels) {
    const PixelDepthCost cost(cameras, pixel, options.loss_width);
    residuals.resize(cost.NumResiduals());
    jacobian.resize(cost.NumResiduals());
    // TinySolver does not say where it cannot start.
    if (pixel.sources.empty() || !cost(&pixel.inverse_depth, residuals.data(), jacobian.data())) {
      pixel.error = pixel.deviation = HUGE_VAL;
      continue;
    }
    Eigen::Matrix<double, 1, 1> inverse_depth(pixel.inverse_depth);
    solver.Solve(cost, &inverse_depth);
    pixel.inverse_depth = inverse_depth[0];
    cost.Judge(pixel);
  }
}

}  // namespace spba
