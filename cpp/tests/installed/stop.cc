// How soon a solve ends once its observer says stop: stop FRAMES PRIOR.safetensors, frames as the samples
// read them. On the machine's own time, half a second; here in seconds of the process's processor time, which
// other programs do not change, on two threads.
#include <cstdio>
#include <cstdlib>
#include <ctime>

#include "../../samples/frames.h"
#include "spba/spba.hpp"

namespace {

constexpr double kMaxSeconds = 2 * 0.5;

double ProcessorSeconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

// Stops at the `call`-th call in a stage whose name starts with `stage`.
bool EndsSoon(const spba::Sequence& sequence, const spba::Prior& prior, const std::string& stage, int call) {
  int calls = 0;
  double stopped = -1.0;
  spba::Callbacks callbacks;
  callbacks.observer = [&](const spba::Progress& progress) {
    if (progress.stage.find(stage) != 0 || ++calls < call) return true;
    stopped = ProcessorSeconds();
    return false;
  };
  try {
    const spba::Solution solution =
        spba::Solve(sequence, prior, spba::Options::FromToml("threads = 2\n"), callbacks);
    if (solution.status() != spba::Status::kStopped) {
      std::fprintf(stderr, "%s has no call %d\n", stage.c_str(), call);
      return false;
    }
  } catch (const spba::Error& error) {
    if (error.code() != spba::Code::kInterrupted) throw;
  }
  const double seconds = ProcessorSeconds() - stopped;
  std::printf("%s, call %d: %.2f s\n", stage.c_str(), call, seconds);
  return seconds <= kMaxSeconds;
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 3) return 2;
  spba::Sequence sequence;
  for (const samples::Frame& frame : samples::ReadFrames(argv[1])) {
    spba::Frame given;
    given.name = frame.name;
    given.image = spba::Raster::Rgb(frame.image.data.data(), frame.image.width, frame.image.height);
    given.mask = spba::Raster::Grey(frame.mask.data.data(), frame.mask.width, frame.mask.height);
    given.depth = spba::Raster::Grey(frame.depth.data.data(), frame.depth.width, frame.depth.height);
    given.camera = frame.camera;
    given.cam_from_world = spba::Rigid3{frame.quaternion_wxyz, frame.translation};
    sequence.Add(given);
  }
  const spba::Prior prior = spba::Prior::Load(argv[2]);
  bool soon = true;
  soon = EndsSoon(sequence, prior, "initialise", 1) && soon;
  soon = EndsSoon(sequence, prior, "initialise", 100) && soon;
  soon = EndsSoon(sequence, prior, "hypothesis", 1) && soon;
  soon = EndsSoon(sequence, prior, "hypothesis-", 60) && soon;
  soon = EndsSoon(sequence, prior, "level-2", 2) && soon;
  soon = EndsSoon(sequence, prior, "level-1", 2) && soon;
  soon = EndsSoon(sequence, prior, "free-form", 3) && soon;
  return soon ? EXIT_SUCCESS : EXIT_FAILURE;
} catch (const std::exception& error) {
  std::fprintf(stderr, "error: %s\n", error.what());
  return EXIT_FAILURE;
}
