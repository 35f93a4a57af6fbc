// An object's terms in a ceres::Problem of one's own: own_problem FRAMES PRIOR.safetensors START.txt
// FRAMES is a folder as frames.h reads it. START.txt: scale, qw qx qy qz and tx ty tz of world_from_object
// (x_world = scale R x_object + t). Refines where and how large the object is, then the cameras, and its
// style all along; prints camera_from_object of each frame (quaternion, translation in object diagonals) and
// the style.
#include <ceres/ceres.h>

#include <cstdio>
#include <fstream>
#include <iostream>
#include <memory>

#include "frames.h"
#include "spba/functors/add_residuals.h"

namespace {

using Layout = spba::functors::QuaternionXyzwTranslationInOne;  // as COLMAP 4 has its poses
using Blocks = spba::functors::ObjectBlocks<Layout>;

constexpr int kThreads = 2;
constexpr int kSteps = 12;
// Fewer points and pixels than the solver's own: the residuals are blocks of their own here.
constexpr char kOptions[] =
    "[objective]\npoints = 3072\nsilhouette_points = 1024\nsilhouette_pixels = 1000\n"
    "silhouette_targets = 8192\n";

struct State {
  std::vector<std::array<double, 7>> camera_from_world;
  std::array<double, 7> world_from_object;
  double log_scale;
  std::vector<double> style;

  Blocks blocks() {
    Blocks blocks;
    for (auto& pose : camera_from_world) blocks.camera_from_world.push_back({pose.data()});
    blocks.world_from_object = {world_from_object.data()};
    blocks.log_scale = &log_scale;
    blocks.style = style.data();
    return blocks;
  }
};

// Keeps the silhouettes' matches where the variables are.
class Rematching : public ceres::EvaluationCallback {
 public:
  Rematching(spba::Correspondences* correspondences, const Blocks& blocks, int styles)
      : correspondences_(*correspondences), blocks_(blocks), styles_(styles) {}
  void PrepareForEvaluation(bool, bool new_evaluation_point) override {
    if (new_evaluation_point) correspondences_.Rematch(spba::functors::EstimateOf(blocks_, styles_));
  }

 private:
  spba::Correspondences& correspondences_;
  const Blocks blocks_;
  const int styles_;
};

// One step of Algorithm 1: what is compared is found anew, then all variables move.
double Step(const std::vector<spba::functors::ShownFrame>& frames, const spba::functors::LinearShape& shape,
            bool free_cameras, spba::Correspondences* correspondences, State* state) {
  const Blocks blocks = state->blocks();
  correspondences->Update(spba::functors::EstimateOf(blocks, shape.style_count()));
  Rematching rematching(correspondences, blocks, shape.style_count());
  ceres::Problem::Options options;
  options.evaluation_callback = &rematching;
  ceres::Problem problem(options);
  for (const auto& pose : blocks.camera_from_world) Layout::AddTo(&problem, pose.data());
  Layout::AddTo(&problem, blocks.world_from_object.data());
  spba::functors::AddObjectResiduals(*correspondences, shape, frames, blocks, &problem);
  spba::functors::AddStylePrior(correspondences->weights(), shape, blocks.style, &problem);
  // All cameras and the similarity together can move without any residual noticing: one of the two is held.
  if (free_cameras) {
    problem.SetParameterBlockConstant(blocks.world_from_object[0]);
    problem.SetParameterBlockConstant(blocks.log_scale);
  } else {
    for (const auto& pose : blocks.camera_from_world) problem.SetParameterBlockConstant(pose[0]);
  }
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  solver.max_num_iterations = 10;
  solver.num_threads = kThreads;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  if (!summary.IsSolutionUsable()) throw std::runtime_error(summary.message);
  return summary.final_cost;
}

State ReadStart(const std::string& path, const std::vector<samples::Frame>& frames, std::size_t styles) {
  State state;
  std::ifstream file(path);
  double scale = 0.0;
  auto& pose = state.world_from_object;
  file >> scale >> pose[3] >> pose[0] >> pose[1] >> pose[2] >> pose[4] >> pose[5] >> pose[6];
  if (!file || !(scale > 0.0)) throw std::runtime_error(path + ": a scale and seven numbers are needed");
  state.log_scale = std::log(scale);
  state.style.assign(styles, 0.0);
  for (const samples::Frame& frame : frames) {
    const auto& q = frame.quaternion_wxyz;
    const auto& t = frame.translation;
    state.camera_from_world.push_back({q[1], q[2], q[3], q[0], t[0], t[1], t[2]});
  }
  return state;
}

// The same camera before the same shape in another frame and unit: R' = R R_c^T, t' = s t - R' t_c.
spba::Rigid3 Before(const spba::Rigid3& pose, const spba::Sim3& canonical_from_shape) {
  const auto& q = canonical_from_shape.quaternion_wxyz;
  const double inverse[4] = {q[0], -q[1], -q[2], -q[3]};
  spba::Rigid3 moved;
  ceres::QuaternionProduct(pose.quaternion_wxyz.data(), inverse, moved.quaternion_wxyz.data());
  double offset[3];
  ceres::QuaternionRotatePoint(moved.quaternion_wxyz.data(), canonical_from_shape.translation.data(), offset);
  for (std::size_t i = 0; i < 3; ++i) {
    moved.translation[i] = canonical_from_shape.scale * pose.translation[i] - offset[i];
  }
  return moved;
}

void Run(const std::string& folder, const std::string& prior_path, const std::string& start_path) {
  const std::vector<samples::Frame> frames = samples::ReadFrames(folder);
  const spba::Prior prior = spba::Prior::Load(prior_path);
  const spba::Options options = spba::Options::FromToml(kOptions);
  State state = ReadStart(start_path, frames, prior.style_count());

  spba::Sequence sequence;
  std::vector<std::vector<float>> colours;
  std::vector<std::unique_ptr<spba::ImageSampler>> samplers;
  std::vector<spba::functors::ShownFrame> shown;
  for (const samples::Frame& frame : frames) {
    spba::Frame given;
    given.name = frame.name;
    given.image = spba::Raster::Rgb(frame.image.data.data(), frame.image.width, frame.image.height);
    given.mask = spba::Raster::Grey(frame.mask.data.data(), frame.mask.width, frame.mask.height);
    given.depth = spba::Raster::Grey(frame.depth.data.data(), frame.depth.width, frame.depth.height);
    given.camera = frame.camera;
    given.cam_from_world = spba::Rigid3{frame.quaternion_wxyz, frame.translation};
    sequence.Add(given);
    colours.emplace_back(frame.image.data.begin(), frame.image.data.end());
    samplers.push_back(std::make_unique<spba::ImageSampler>(
        colours.back().data(), static_cast<int>(frame.image.width), static_cast<int>(frame.image.height)));
    shown.push_back({frame.camera, samplers.back().get()});
  }

  const int styles = static_cast<int>(prior.style_count());
  spba::Correspondences correspondences(sequence, prior, options,
                                        spba::functors::EstimateOf(state.blocks(), styles));
  const auto shape = spba::functors::LinearShape::Of(prior, correspondences.weights().point_count);
  for (int step = 0; step < kSteps; ++step) {
    // One step brings the object to where the cameras look. In more of them its shape would bend to what is
    // wrong with the cameras.
    const bool free_cameras = step > 0;
    const double cost = Step(shown, shape, free_cameras, &correspondences, &state);
    std::cerr << "step " << step << (free_cameras ? ", cameras" : ", object") << ": cost " << cost << "\n";
  }
  spba::Estimate found = spba::functors::EstimateOf(state.blocks(), styles);
  if (const auto canonical_from_shape = prior.CanonicalFromShape(state.style)) {
    for (spba::Rigid3& pose : found.cam_from_object) pose = Before(pose, *canonical_from_shape);
  }
  for (std::size_t l = 0; l < frames.size(); ++l) {
    const spba::Rigid3& pose = found.cam_from_object[l];
    std::printf("frame %s", frames[l].name.c_str());
    for (const double x : pose.quaternion_wxyz) std::printf(" %.17g", x);
    for (const double x : pose.translation) std::printf(" %.17g", x);
    std::printf("\n");
  }
  std::printf("style");
  for (const double s : state.style) std::printf(" %.17g", s);
  std::printf("\n");
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 4) {
    std::cerr << "usage: own_problem FRAMES PRIOR.safetensors START.txt\n";
    return 2;
  }
  Run(argv[1], argv[2], argv[3]);
  return 0;
} catch (const std::exception& error) {
  std::cerr << "error: " << error.what() << "\n";
  return 1;
}
