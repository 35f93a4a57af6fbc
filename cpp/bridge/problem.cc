#include "bridge/problem.h"

#include <cmath>
#include <stdexcept>
#include <utility>
#include <vector>

#include "core/terms/focal.h"
#include "core/terms/inverse_depth.h"
#include "core/terms/motion.h"
#include "core/terms/photometric.h"
#include "core/terms/silhouette.h"
#include "core/terms/style.h"
#include "spba-ceres/src/bridge/ceres.rs.h"

namespace spba {
namespace bridge {
namespace {

void Require(bool holds, const char* what) {
  if (!holds) throw std::invalid_argument(what);
}

Pinhole ToCore(const Camera& camera) {
  Require(std::isfinite(camera.fx) && std::isfinite(camera.fy) && std::isfinite(camera.cx) &&
              std::isfinite(camera.cy) && camera.fx > 0 && camera.fy > 0,
          "a camera's focal length must be positive and its principal point finite");
  return {camera.fx, camera.fy, camera.cx, camera.cy};
}

std::unique_ptr<SilhouetteLookup> ToCore(const NearestPixels& silhouette) {
  Require(silhouette.width > 0 && silhouette.grid_width > 0 && silhouette.grid_height > 0 &&
              silhouette.nearest.size() == size_t{silhouette.grid_width} * silhouette.grid_height,
          "a distance transform must hold grid_width x grid_height entries");
  Require(!silhouette.boundary.empty(), "a silhouette must not be empty");
  return std::make_unique<SilhouetteLookup>(
      static_cast<int>(silhouette.width), static_cast<int>(silhouette.padding),
      static_cast<int>(silhouette.grid_width), static_cast<int>(silhouette.grid_height),
      std::vector<uint32_t>(silhouette.nearest.begin(), silhouette.nearest.end()),
      std::vector<uint32_t>(silhouette.boundary.begin(), silhouette.boundary.end()));
}

Prior ToCore(rust::Box<PriorCallback> callback) {
  Prior prior;
  prior.point_count = static_cast<int>(callback->point_count());
  prior.style_count = static_cast<int>(callback->style_count());
  Require(prior.point_count > 0 && prior.style_count > 0, "the prior must have points and styles");
  uint64_t axis_styles = 0;
  for (const bridge::AxisStyles& styles : callback->axis_styles()) {
    axis_styles += styles.count;
    Require(styles.axis < 3 && axis_styles <= static_cast<uint64_t>(prior.style_count),
            "axis styles must be some of the styles, along one of three axes");
    prior.axis_styles.push_back({static_cast<int>(styles.axis), static_cast<int>(styles.count)});
  }
  const auto shared = std::make_shared<rust::Box<PriorCallback>>(std::move(callback));
  const rust::Slice<const double> constant = (*shared)->constant_jacobian();
  if (!constant.empty()) {
    Require(constant.size() == 3 * size_t(prior.point_count) * size_t(prior.style_count),
            "the prior's constant Jacobian must have three rows a point and a column a style");
    prior.constant_jacobian = constant.data();
  }
  prior.points = [shared](const std::vector<double>& style, std::vector<double>* points) {
    (*shared)->points({style.data(), style.size()}, {points->data(), points->size()});
  };
  prior.jacobian = [shared](const std::vector<double>& style, std::vector<double>* jacobian) {
    (*shared)->jacobian({style.data(), style.size()}, {jacobian->data(), jacobian->size()});
  };
  return prior;
}

SilhouetteOptions ToCore(const SilhouetteTerm& term, const Footage& footage, int points) {
  SilhouetteOptions options;
  options.weight = term.weight;
  options.cauchy_width = term.cauchy_width;
  options.tolerance = term.tolerance;
  Require(term.frames.size() == footage.core().frames.size(), "one share of the silhouettes a frame");
  for (size_t l = 0; l < term.frames.size(); ++l) {
    const bridge::SilhouetteShare& share = term.frames[l];
    Require(share.points <= static_cast<uint32_t>(points), "no such point");
    spba::SilhouetteShare& own = options.frames.emplace_back();
    const uint32_t width = footage.silhouette_width(l);
    for (const uint32_t index : share.pixels) {
      own.pixels.emplace_back(index % width + 0.5, index / width + 0.5);
    }
    own.pixel_weight = share.pixel_weight;
    own.points = static_cast<int>(share.points);
    own.point_weight = share.point_weight;
  }
  return options;
}

spba::LinearSolver ToCore(LinearSolver solver) {
  switch (solver) {
    case LinearSolver::DenseSchur:
      return spba::LinearSolver::kDenseSchur;
    case LinearSolver::SparseSchur:
      return spba::LinearSolver::kSparseSchur;
    case LinearSolver::SparseNormalCholesky:
      return spba::LinearSolver::kSparseNormalCholesky;
    case LinearSolver::DenseNormalCholesky:
      return spba::LinearSolver::kDenseNormalCholesky;
    case LinearSolver::IterativeSchur:
      return spba::LinearSolver::kIterativeSchur;
  }
  throw std::invalid_argument("no such linear solver");
}

spba::Interpolation ToCore(Interpolation interpolation) {
  switch (interpolation) {
    case Interpolation::Cubic:
      return spba::Interpolation::kCubic;
    case Interpolation::Quadratic:
      return spba::Interpolation::kQuadratic;
    case Interpolation::Bisection:
      return spba::Interpolation::kBisection;
  }
  throw std::invalid_argument("no such interpolation");
}

spba::PoseMotion ToCore(PoseMotion motion) {
  switch (motion) {
    case PoseMotion::Held:
      return spba::PoseMotion::kHeld;
    case PoseMotion::Each:
      return spba::PoseMotion::kEach;
    case PoseMotion::Sources:
      return spba::PoseMotion::kSources;
    case PoseMotion::Together:
      return spba::PoseMotion::kTogether;
  }
  throw std::invalid_argument("no such motion of the poses");
}

Costs FromCore(const spba::Costs& costs) {
  return {costs[kPhotometric], costs[kSilhouette], costs[kInverseDepth],
          costs[kStyle],       costs[kMotion],     costs[kFocal]};
}

void FromCore(const spba::Variables& core, Variables* variables) {
  using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  for (size_t l = 0; l < core.camera_from_object.size(); ++l) {
    Pose& pose = variables->camera_from_object[l];
    Eigen::Map<RowMajor3>(pose.rotation.data()) = core.camera_from_object[l].rotation;
    Eigen::Map<Vector3>(pose.translation.data()) = core.camera_from_object[l].translation;
  }
  std::copy(core.style.begin(), core.style.end(), variables->style.begin());
  variables->log_alpha = core.log_alpha;
  variables->log_focal = core.log_focal;
}

}  // namespace

Footage::Footage(rust::Vec<FrameFootage> frames) : frames_(std::move(frames)) {
  for (FrameFootage& frame : frames_) {
    spba::FrameFootage& own = core_.frames.emplace_back();
    own.camera = ToCore(frame.camera);
    for (const bridge::LevelImage& level : frame.levels) {
      const rust::Slice<const float> rgb = level.image->rgb();
      const size_t width = level.image->width(), height = level.image->height();
      Require(width > 0 && height > 0 && rgb.size() == 3 * width * height,
              "an image's data must be width x height x 3");
      own.levels.push_back(std::make_unique<spba::LevelImage>(
          ToCore(level.camera), rgb.data(), static_cast<int>(width), static_cast<int>(height)));
    }
    own.silhouette = ToCore(frame.silhouette);
    // Copied; not to be held twice.
    frame.silhouette.nearest = {};
  }
}

Footage::~Footage() = default;

uint32_t Footage::silhouette_width(size_t frame) const { return frames_[frame].silhouette.width; }

std::shared_ptr<Footage> new_footage(rust::Vec<FrameFootage> frames) {
  Require(frames.size() >= 2, "photometric bundle adjustment needs at least two frames");
  return std::make_shared<Footage>(std::move(frames));
}

Problem::Problem(std::shared_ptr<Footage> footage, rust::Box<PriorCallback> prior, const Terms& terms)
    : footage_(std::move(footage)),
      objective_(std::shared_ptr<const spba::Footage>(footage_, &footage_->core()),
                 bridge::ToCore(std::move(prior)), terms.weak_perspective) {
  const int frames = static_cast<int>(footage_->core().frames.size());
  if (terms.photometric.weight > 0) {
    PhotometricOptions options;
    options.weight = terms.photometric.weight;
    options.huber_width = terms.photometric.huber_width;
    objective_.Add(MakePhotometricTerm(options));
  }
  if (terms.silhouette.weight > 0) {
    objective_.Add(
        MakeSilhouetteTerm(bridge::ToCore(terms.silhouette, *footage_, objective_.prior().point_count)));
  }
  if (terms.inverse_depth.weight > 0) {
    InverseDepthOptions options;
    options.weight = terms.inverse_depth.weight;
    options.huber_width = terms.inverse_depth.huber_width;
    options.frames = frames;
    objective_.Add(MakeInverseDepthTerm(options));
  }
  if (terms.style.weight > 0) {
    StyleOptions options;
    options.weight = terms.style.weight;
    objective_.Add(MakeStyleTerm(options));
  }
  if (terms.motion.weight > 0 && !terms.motion.motions.empty()) {
    MotionOptions options;
    options.weight = terms.motion.weight;
    options.cauchy_width = terms.motion.cauchy_width;
    options.frames = frames;
    for (const bridge::KnownMotion& motion : terms.motion.motions) {
      Require(motion.a < static_cast<uint32_t>(frames) && motion.b < static_cast<uint32_t>(frames) &&
                  motion.a != motion.b,
              "a known motion is between two of the frames");
      spba::KnownMotion& own = options.motions.emplace_back();
      own.a = static_cast<int>(motion.a);
      own.b = static_cast<int>(motion.b);
      std::copy(motion.rotation.begin(), motion.rotation.end(), own.error.rotation);
      std::copy(motion.translation.begin(), motion.translation.end(), own.error.translation);
    }
    objective_.Add(MakeMotionTerm(std::move(options)));
  }
  if (terms.focal.deviation > 0) {
    FocalOptions options;
    options.deviation = terms.focal.deviation;
    objective_.Add(MakeFocalTerm(options));
  }
}

spba::Variables Problem::ToCore(const Variables& variables) const {
  Require(variables.camera_from_object.size() == footage_->core().frames.size() &&
              variables.style.size() == static_cast<size_t>(objective_.prior().style_count),
          "one pose a frame, and as many styles as the prior has");
  spba::Variables core;
  for (const Pose& pose : variables.camera_from_object) {
    spba::Pose& own = core.camera_from_object.emplace_back();
    own.rotation = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(pose.rotation.data());
    own.translation = Eigen::Map<const Vector3>(pose.translation.data());
    Require(own.rotation.allFinite() && own.translation.allFinite(), "a pose is not finite");
  }
  core.style.assign(variables.style.begin(), variables.style.end());
  core.log_alpha = variables.log_alpha;
  core.log_focal = variables.log_focal;
  return core;
}

Evaluation Problem::Evaluate(const Variables& variables, const Visibility& visibility, Want want,
                             uint32_t threads) {
  Evaluation evaluation =
      objective_.Evaluate(ToCore(variables), visibility.core(), want, static_cast<int>(threads), &memory_);
  if (!evaluation.ok()) throw std::runtime_error(evaluation.failure);
  return evaluation;
}

Costs Problem::evaluate(const Variables& variables, const Visibility& visibility, uint32_t threads) {
  return FromCore(Evaluate(variables, visibility, Want{}, threads).equations.costs);
}

Derivatives Problem::differentiate(const Variables& variables, const Visibility& visibility,
                                   uint32_t threads) {
  const NormalEquations equations =
      Evaluate(variables, visibility, Want{Want::Order::kNormalMatrix}, threads).equations;
  Derivatives derivatives;
  for (const double value : equations.gradient) derivatives.gradient.push_back(value);
  derivatives.normal_matrix.reserve(static_cast<size_t>(equations.matrix.size()));
  for (Eigen::Index i = 0; i < equations.matrix.size(); ++i) {
    derivatives.normal_matrix.push_back(equations.matrix.data()[i]);
  }
  return derivatives;
}

Summary Problem::minimise(Variables& variables, const Visibility& visibility, const MinimiseOptions& options,
                          Observer& observer) {
  Free free;
  free.poses = bridge::ToCore(options.poses);
  free.style = options.free_style;
  free.log_alpha = options.free_alpha;
  free.log_focal = options.free_focal;
  spba::MinimiseOptions own;
  own.evaluation = options.blocks ? EvaluationKind::kBlocks : EvaluationKind::kAccumulated;
  own.line_search = options.line_search;
  own.lbfgs_rank = static_cast<int>(options.lbfgs_rank);
  own.interpolation = bridge::ToCore(options.interpolation);
  own.initial_trust_region_radius = options.initial_trust_region_radius;
  own.linear_solver = bridge::ToCore(options.linear_solver);
  own.max_iterations = static_cast<int>(options.max_iterations);
  own.tolerance = options.tolerance;
  own.threads = static_cast<int>(options.threads);
  Require(options.target < footage_->core().frames.size(), "no such target frame");
  const auto on_iteration = [&](const IterationState& state) {
    return observer.on_iteration({static_cast<uint32_t>(state.number), FromCore(state.costs),
                                  state.variables.log_alpha, state.gradient_norm,
                                  static_cast<uint32_t>(state.counts.residual),
                                  static_cast<uint32_t>(state.counts.jacobian)});
  };
  spba::Variables core = ToCore(variables);
  const Outcome outcome = Minimise(objective_, visibility.core(), free, static_cast<int>(options.target), own,
                                   on_iteration, &memory_, &core);
  FromCore(core, &variables);
  return {static_cast<uint32_t>(outcome.iterations), static_cast<uint32_t>(outcome.counts.residual),
          static_cast<uint32_t>(outcome.counts.jacobian), outcome.interrupted, outcome.trust_region_radius};
}

std::unique_ptr<Problem> new_problem(std::shared_ptr<Footage> footage, rust::Box<PriorCallback> prior,
                                     const Terms& terms) {
  return std::make_unique<Problem>(std::move(footage), std::move(prior), terms);
}

std::unique_ptr<Visibility> new_visibility(const Problem& problem, const VisibilityInput& input) {
  const spba::Footage& footage = problem.objective().footage();
  const auto frames = static_cast<uint32_t>(footage.frames.size());
  const int points = problem.objective().prior().point_count;
  spba::Visibility visibility;
  visibility.level = static_cast<int>(input.level);
  for (const spba::FrameFootage& frame : footage.frames) {
    Require(input.level < frame.levels.size(), "no such pyramid level");
  }
  for (const FramePair& pair : input.pairs) {
    Require(pair.a < frames && pair.b < frames && pair.a != pair.b, "a pair is of two of the frames");
    visibility.pairs.push_back({pair.a, pair.b, pair.weight});
  }
  for (const bridge::Comparison& comparison : input.comparisons) {
    Require(comparison.point < static_cast<uint32_t>(points), "no such point");
    Require(comparison.pair < visibility.pairs.size(), "no such pair");
  }
  visibility.comparisons = PointLists<spba::Comparison>(
      points, input.comparisons.size(), [&](size_t i) { return input.comparisons[i].point; },
      [&](size_t i) {
        return spba::Comparison{input.comparisons[i].pair, input.comparisons[i].directions};
      });
  for (const bridge::SeenDepth& seen : input.depths) {
    Require(seen.point < static_cast<uint32_t>(points) && seen.frame < frames, "no such point or frame");
  }
  visibility.depths = PointLists<spba::SeenDepth>(
      points, input.depths.size(), [&](size_t i) { return input.depths[i].point; },
      [&](size_t i) {
        const bridge::SeenDepth& seen = input.depths[i];
        return spba::SeenDepth{seen.frame,
                               {footage.frames[seen.frame].camera,
                                {seen.column, seen.row},
                                seen.inverse_depth,
                                {seen.by_column, seen.by_row}},
                               seen.weight};
      });
  Require(input.silhouette_weights.size() <= static_cast<size_t>(points), "no such point");
  visibility.silhouette_weights.assign(input.silhouette_weights.begin(), input.silhouette_weights.end());
  return std::make_unique<Visibility>(std::move(visibility));
}

}  // namespace bridge
}  // namespace spba
