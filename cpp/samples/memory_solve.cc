// Solves from memory: memory_solve FRAMES PRIOR.safetensors [OPTIONS.toml]
// FRAMES is a folder as frames.h reads it. Prints what was found, every number with all its digits.
#include <cstdio>
#include <fstream>
#include <iostream>
#include <iterator>

#include "frames.h"
#include "spba/spba.hpp"

namespace {

void Print(const char* what, const double* values, std::size_t count) {
  std::printf("%s", what);
  for (std::size_t i = 0; i < count; ++i) std::printf(" %.17g", values[i]);
  std::printf("\n");
}

void Run(const std::string& folder, const std::string& prior_path, const std::string& options_path) {
  const std::vector<samples::Frame> frames = samples::ReadFrames(folder);
  spba::Sequence sequence;
  for (const samples::Frame& frame : frames) {
    spba::Frame given;
    given.name = frame.name;
    given.image = spba::Raster::Rgb(frame.image.data.data(), frame.image.width, frame.image.height);
    given.mask = spba::Raster::Grey(frame.mask.data.data(), frame.mask.width, frame.mask.height);
    given.depth = spba::Raster::Grey(frame.depth.data.data(), frame.depth.width, frame.depth.height);
    given.camera = frame.camera;
    given.cam_from_world = spba::Rigid3{frame.quaternion_wxyz, frame.translation};
    sequence.Add(given);
  }
  spba::Options options;
  if (!options_path.empty()) {
    std::ifstream file(options_path);
    options = spba::Options::FromToml({std::istreambuf_iterator<char>(file), {}});
  }
  spba::Callbacks callbacks;
  callbacks.log = [](spba::LogLevel level, const std::string& message) {
    if (level != spba::LogLevel::kDebug) std::cerr << message << "\n";
  };
  const spba::Solution solution = spba::Solve(sequence, spba::Prior::Load(prior_path), options, callbacks);

  for (std::size_t i = 0; i < solution.frame_count(); ++i) {
    const spba::Rigid3 pose = solution.cam_from_object(i);
    std::printf("frame %s iou %.17g", frames[i].name.c_str(), solution.silhouette_iou(i));
    Print(" quaternion_wxyz", pose.quaternion_wxyz.data(), 4);
    Print("translation", pose.translation.data(), 3);
  }
  if (const std::optional<spba::Sim3> object_from_world = solution.object_from_world()) {
    Print("object_from_world scale", &object_from_world->scale, 1);
    Print("object_from_world quaternion_wxyz", object_from_world->quaternion_wxyz.data(), 4);
    Print("object_from_world translation", object_from_world->translation.data(), 3);
  }
  Print("style", solution.style().data(), solution.style().size());
  const double objective = solution.objective_end();
  Print("objective", &objective, 1);
  std::printf("points %zu faces %zu\n", solution.points().size() / 3, solution.faces().size() / 3);
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc < 3 || argc > 4) {
    std::cerr << "usage: memory_solve FRAMES PRIOR.safetensors [OPTIONS.toml]\n";
    return 2;
  }
  Run(argv[1], argv[2], argc > 3 ? argv[3] : "");
  return 0;
} catch (const std::exception& error) {
  std::cerr << "error: " << error.what() << "\n";
  return 1;
}
