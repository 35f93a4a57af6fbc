#include "problem.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "spba-ceres/src/bridge/ceres.rs.h"

namespace spba {
namespace {

void Require(bool holds, const char* what) {
  if (!holds) throw std::invalid_argument(what);
}

Pinhole ToPinhole(const Camera& camera) {
  Require(std::isfinite(camera.cx) && std::isfinite(camera.cy) && camera.fx > 0 && camera.fy > 0,
          "a camera's focal length must be positive and its principal point finite");
  return {camera.fx, camera.fy, camera.cx, camera.cy};
}

Prior FromCallback(rust::Box<PriorCallback> callback) {
  const auto shared = std::make_shared<rust::Box<PriorCallback>>(std::move(callback));
  const auto call = [shared](void (PriorCallback::*method)(rust::Slice<const double>, rust::Slice<double>)
                                 const,
                             const std::vector<double>& style, std::vector<double>* values) {
    (**shared.*method)({style.data(), style.size()}, {values->data(), values->size()});
  };
  return {[call](const auto& style, auto* points) { call(&PriorCallback::points, style, points); },
          [call](const auto& style, auto* jacobian) { call(&PriorCallback::jacobian, style, jacobian); }};
}

}  // namespace

Problem::Problem(const ProblemOptions& options, Prior prior)
    : weights_{options.photometric_weight, options.photometric_huber,    options.silhouette_weight,
               options.silhouette_cauchy,  options.inverse_depth_weight, options.inverse_depth_huber,
               options.style_weight,       options.style_reach,          options.motion_weight,
               options.motion_cauchy},
      state_(std::move(prior), static_cast<int>(options.points), static_cast<int>(options.style)),
      photometric_(options.frames),
      inverse_depth_(options.frames),
      silhouette_weights_(options.frames),
      motion_(options.frames) {
  state_.inputs.resize(options.frames);
  state_.silhouette_tolerance = options.silhouette_tolerance;
  state_.weak_perspective = options.weak_perspective;
  state_.variables.target_from_object.setZero();
  state_.variables.motion.assign(options.frames - 1, Vector6::Zero());
}

Problem::~Problem() = default;

void Problem::CheckFrame(size_t frame) const { Require(frame < photometric_.size(), "no such frame"); }

void Problem::CheckPoints(rust::Slice<const uint32_t> points) const {
  for (const uint32_t point : points) {
    Require(point < static_cast<uint32_t>(state_.point_count()), "no such point");
  }
}

void Problem::Changed() {
  objective_.reset();
  state_.Invalidate();
}

void Problem::set_camera(size_t frame, const Camera& camera) {
  CheckFrame(frame);
  state_.inputs[frame].camera = ToPinhole(camera);
  Changed();
}

void Problem::set_image(size_t frame, uint32_t width, uint32_t height, rust::Slice<const float> rgb,
                        const Camera& camera) {
  CheckFrame(frame);
  Require(width > 0 && height > 0 && rgb.size() == size_t{3} * width * height,
          "an image's data must be width x height x 3");
  Photometric& photometric = photometric_[frame];
  photometric.camera = ToPinhole(camera);
  photometric.rgb.assign(rgb.begin(), rgb.end());
  photometric.image = std::make_unique<ImageSampler>(photometric.rgb.data(), width, height);
  Changed();
}

void Problem::set_silhouette(size_t frame, const Silhouette& silhouette) {
  CheckFrame(frame);
  Require(silhouette.width > 0 && silhouette.grid_width > 0 && silhouette.grid_height > 0 &&
              silhouette.nearest.size() == size_t{silhouette.grid_width} * silhouette.grid_height,
          "a distance transform must hold grid_width x grid_height entries");
  Require(!silhouette.boundary.empty(), "a silhouette must not be empty");
  Require(silhouette.points <= static_cast<uint32_t>(state_.point_count()), "no such point");
  FrameInput& input = state_.inputs[frame];
  input.silhouette = std::make_unique<SilhouetteLookup>(
      silhouette.width, silhouette.padding, silhouette.grid_width, silhouette.grid_height,
      std::vector<uint32_t>(silhouette.nearest.begin(), silhouette.nearest.end()),
      std::vector<uint32_t>(silhouette.boundary.begin(), silhouette.boundary.end()));
  input.silhouette_points = static_cast<int>(silhouette.points);
  input.silhouette_pixels.clear();
  for (const uint32_t index : silhouette.pixels) {
    input.silhouette_pixels.emplace_back(index % silhouette.width + 0.5, index / silhouette.width + 0.5);
  }
  silhouette_weights_[frame] = {silhouette.pixel_weight, silhouette.point_weight};
  Changed();
}

void Problem::set_photometric(size_t frame, rust::Slice<const uint32_t> points,
                              rust::Slice<const uint8_t> directions) {
  CheckFrame(frame);
  Require(frame > 0, "the target frame is not compared with itself");
  Require(points.size() == directions.size(), "one count of directions a point");
  CheckPoints(points);
  photometric_[frame].points.assign(points.begin(), points.end());
  photometric_[frame].directions.assign(directions.begin(), directions.end());
  Changed();
}

void Problem::set_inverse_depth(size_t frame, rust::Slice<const SeenDepth> seen) {
  CheckFrame(frame);
  InverseDepth inverse_depth;
  for (const SeenDepth& depth : seen) {
    Require(depth.point < static_cast<uint32_t>(state_.point_count()), "no such point");
    inverse_depth.points.push_back(depth.point);
    inverse_depth.errors.push_back({state_.inputs[frame].camera,
                                    {depth.column, depth.row},
                                    depth.inverse_depth,
                                    {depth.by_column, depth.by_row}});
  }
  inverse_depth_[frame] = std::move(inverse_depth);
  Changed();
}

void Problem::set_motion(size_t frame, const InputMotion& motion) {
  CheckFrame(frame);
  Require(frame > 0, "the target frame does not move against itself");
  MotionError error;
  std::copy(motion.rotation.begin(), motion.rotation.end(), error.rotation);
  std::copy(motion.translation.begin(), motion.translation.end(), error.translation);
  motion_[frame] = error;
  Changed();
}

void Problem::set_alpha(double alpha) {
  Require(std::isfinite(alpha) && alpha > 0, "alpha must be positive");
  state_.variables.log_alpha = std::log(alpha);
}

double Problem::alpha() const { return std::exp(state_.variables.log_alpha); }

void Problem::set_variables(rust::Slice<const double> target_from_object, rust::Slice<const double> motion,
                            rust::Slice<const double> style) {
  Variables& variables = state_.variables;
  Require(target_from_object.size() == 6 && motion.size() == 6 * variables.motion.size() &&
              style.size() == variables.style.size(),
          "p0 has 6 entries, the motion 6 (L - 1), the style S");
  std::copy(target_from_object.begin(), target_from_object.end(), variables.target_from_object.data());
  for (size_t l = 0; l < variables.motion.size(); ++l) {
    std::copy_n(motion.data() + 6 * l, 6, variables.motion[l].data());
  }
  std::copy(style.begin(), style.end(), variables.style.begin());
}

void Problem::get_variables(rust::Slice<double> target_from_object, rust::Slice<double> motion,
                            rust::Slice<double> style) const {
  const Variables& variables = state_.variables;
  Require(target_from_object.size() == 6 && motion.size() == 6 * variables.motion.size() &&
              style.size() == variables.style.size(),
          "p0 has 6 entries, the motion 6 (L - 1), the style S");
  std::copy_n(variables.target_from_object.data(), 6, target_from_object.data());
  for (size_t l = 0; l < variables.motion.size(); ++l) {
    std::copy_n(variables.motion[l].data(), 6, motion.data() + 6 * l);
  }
  std::copy(variables.style.begin(), variables.style.end(), style.data());
}

void Problem::Prepare(bool with_jacobian) {
  if (!objective_) {
    objective_ = std::make_unique<Objective>(&state_, weights_);
    for (size_t l = 0; l < photometric_.size(); ++l) {
      const int frame = static_cast<int>(l);
      if (state_.inputs[l].silhouette) {
        objective_->AddSilhouette(frame, silhouette_weights_[l].pixel, silhouette_weights_[l].point);
      }
      objective_->AddInverseDepth(frame, inverse_depth_[l].points, inverse_depth_[l].errors);
      if (motion_[l]) objective_->AddMotion(frame, *motion_[l]);
      if (photometric_[l].points.empty()) continue;
      Require(photometric_[0].image && photometric_[l].image,
              "photometric points in a frame without an image");
      photometric_[l].error = {photometric_[0].camera, photometric_[l].camera, photometric_[0].image.get(),
                               photometric_[l].image.get()};
      objective_->AddPhotometric(frame, photometric_[l].points, photometric_[l].directions,
                                 photometric_[l].error);
    }
  }
  if (!state_.Update(with_jacobian)) throw std::runtime_error(state_.failure());
  for (const FrameState& frame : state_.frames) {
    if (!frame.in_front) throw std::runtime_error("a point of the shape lies behind a camera");
  }
}

std::unique_ptr<Problem> new_problem(const ProblemOptions& options, rust::Box<PriorCallback> prior) {
  Require(options.frames >= 2, "photometric bundle adjustment needs at least two frames");
  Require(options.points > 0 && options.style > 0, "the prior must have points and styles");
  return std::make_unique<Problem>(options, FromCallback(std::move(prior)));
}

}  // namespace spba
