// What a host may do wrong or at once with an installed libspba, and what must come of it.
#include <glog/logging.h>

#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <thread>

#include "sphere.h"

namespace {

void Require(bool holds, const std::string& what) {
  if (holds) return;
  std::fprintf(stderr, "FAILED: %s\n", what.c_str());
  std::exit(1);
}

// `work` throws a spba::Error of this code, whose message has all of `parts`.
template <typename Work>
void Refused(spba::Code code, const std::vector<std::string>& parts, Work work) {
  try {
    work();
  } catch (const spba::Error& error) {
    const std::string message = error.what();
    Require(error.code() == code, "another code: " + message);
    for (const std::string& part : parts) {
      Require(message.find(part) != std::string::npos, "`" + part + "` is not in: " + message);
    }
    Require(message.find('\n') == std::string::npos, "more than a line: " + message);
    return;
  }
  Require(false, "accepted, where it should say " + parts.front());
}

// `spoil` makes the second of three frames one that is refused, when it is added or when all are solved.
template <typename Spoil>
void RefusedFrame(const std::vector<std::string>& parts, Spoil spoil) {
  Refused(spba::Code::kInvalidInput, parts, [&] {
    spba::Sequence sequence;
    for (int i = 0; i < 3; ++i) {
      sphere::Pictures pictures(i);
      spba::Frame frame = pictures.View("frame" + std::to_string(i));
      if (i == 1) spoil(&frame, &pictures);
      sequence.Add(frame);
    }
    spba::Solve(sequence, sphere::MakePrior(), sphere::QuickOptions());
  });
}

void BadFrames() {
  using spba::Frame;
  using sphere::Pictures;
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  RefusedFrame({"frames[1] `frame1`", "quaternion_wxyz", "norm is NaN"}, [](Frame* frame, Pictures*) {
    frame->cam_from_world = spba::Rigid3{{kNan, 0, 0, 0}, {}};
  });
  RefusedFrame({"frames[1] `frame1`", "quaternion_wxyz", "norm is 0"}, [](Frame* frame, Pictures*) {
    frame->cam_from_world = spba::Rigid3{{0, 0, 0, 0}, {}};
  });
  RefusedFrame({"frames[1]", "translation", "not finite"}, [](Frame* frame, Pictures*) {
    frame->cam_from_world = spba::Rigid3{{1, 0, 0, 0}, {0, kNan, 0}};
  });
  RefusedFrame({"frames[1] `frame1`", "mask", "it is null"},
               [](Frame* frame, Pictures*) { frame->mask = spba::Raster(); });
  RefusedFrame({"frames[1] `frame1`", "image", "it is null"},
               [](Frame* frame, Pictures*) { frame->image = spba::Raster(); });
  RefusedFrame({"frames[1] `frame1`", "mask", "empty"}, [](Frame*, Pictures* pictures) {
    for (std::uint8_t& value : pictures->mask) value = value != 0 ? 1 : 0;
  });
  RefusedFrame({"frames[1] `frame1`", "mask", "covers"}, [](Frame*, Pictures* pictures) {
    for (std::uint8_t& value : pictures->mask) value = 255;
  });
  RefusedFrame({"frames[1].mask", "95", "96"}, [](Frame* frame, Pictures* pictures) {
    frame->mask = spba::Raster::Grey(pictures->mask.data(), 95, sphere::kHeight);
  });
  RefusedFrame({"frames[1] `frame1`.image", "row_stride is 10"}, [](Frame* frame, Pictures* pictures) {
    frame->image = spba::Raster::Rgb(pictures->rgb.data(), sphere::kWidth, sphere::kHeight, 10);
  });
  RefusedFrame({"frames[1] `frame1`.mask", "three channels"},
               [](Frame* frame, Pictures*) { frame->mask = frame->image; });
  RefusedFrame({"frames[1].camera.fx", "NaN"}, [](Frame* frame, Pictures*) { frame->camera.fx = kNan; });
  RefusedFrame({"frames[1].name", "taken"}, [](Frame* frame, Pictures*) { frame->name = "frame0"; });
  std::vector<float> depth(sphere::kWidth * sphere::kHeight, -1.0f);
  RefusedFrame({"frames[1].depth", "negative"}, [&](Frame* frame, Pictures*) {
    frame->depth = spba::Raster::Grey(depth.data(), sphere::kWidth, sphere::kHeight);
  });
  Refused(spba::Code::kInvalidInput, {"frames: 1 left", "add frames"},
          [] { spba::Solve(sphere::MakeSequence(1), sphere::MakePrior()); });
}

void BadPriorsAndOptions() {
  using spba::Code;
  Refused(Code::kInvalidPrior, {"/no/such/prior"}, [] { spba::Prior::Load("/no/such/prior"); });
  Refused(Code::kInvalidPrior, {"diagonal"}, [] {
    spba::Prior::Linear({0, 0, 0, 1, 1, 1}, std::vector<double>(6, 0.0), 1, {1, 0, 0, 1, 0, 0});
  });
  Refused(Code::kInvalidPrior, {"unit length"}, [] {
    spba::Prior::Linear({0, 0, 0, 1, 1, 1}, std::vector<double>(6, 0.0), 1, std::vector<double>(6, 0.0));
  });
  Refused(Code::kInvalidOptions, {"objektive"}, [] { spba::Options::FromToml("[objektive]\n"); });
  Refused(Code::kInvalidOptions, {"max_steps", "1 or more"},
          [] { spba::Options::FromToml("[solver]\nmax_steps = 0\n"); });
  Refused(Code::kInvalidOptions, {"input", "leave it out"},
          [] { spba::Options::FromToml("[input]\nevery = 2\n"); });
  Refused(Code::kInvalidOptions, {"target 7"}, [] {
    spba::Solve(sphere::MakeSequence(2), sphere::MakePrior(),
                spba::Options::FromToml("[input]\ntarget = 7\n"));
  });
}

std::vector<double> Numbers(const spba::Solution& solution) {
  std::vector<double> numbers(solution.style().begin(), solution.style().end());
  for (std::size_t i = 0; i < solution.frame_count(); ++i) {
    const spba::Rigid3 pose = solution.cam_from_object(i);
    numbers.insert(numbers.end(), pose.quaternion_wxyz.begin(), pose.quaternion_wxyz.end());
    numbers.insert(numbers.end(), pose.translation.begin(), pose.translation.end());
  }
  return numbers;
}

std::vector<double> SolveOnce(const spba::Callbacks& callbacks = {}) {
  return Numbers(
      spba::Solve(sphere::MakeSequence(3), sphere::MakePrior(), sphere::QuickOptions(), callbacks));
}

void Callbacks() {
  std::atomic<int> inside{0};
  bool alone = true;
  int calls = 0, messages = 0;
  spba::Callbacks callbacks;
  callbacks.observer = [&](const spba::Progress& progress) {
    alone = alone && ++inside == 1;
    ++calls;
    Require(progress.stage == "initialise" || std::isfinite(progress.objective), "an objective");
    --inside;
    return true;
  };
  callbacks.log = [&](spba::LogLevel, const std::string&) { ++messages; };
  const std::vector<double> watched = SolveOnce(callbacks);
  Require(alone && calls > 10 && messages > 0, "an observer is called, by one thread at a time, and a log");
  Require(watched == SolveOnce(), "watching changes nothing");

  for (const char* const stage : {"initialise", "hypothesis", "level"}) {
    spba::Callbacks throwing;
    throwing.observer = [&](const spba::Progress& progress) -> bool {
      if (progress.stage.find(stage) == 0) throw std::range_error(stage);
      return true;
    };
    try {
      SolveOnce(throwing);
      Require(false, "what an observer throws arrives");
    } catch (const std::range_error& error) {
      Require(error.what() == std::string(stage), "what an observer throws arrives whole");
    }
  }
  spba::Callbacks throwing_log;
  throwing_log.log = [](spba::LogLevel, const std::string&) { throw std::range_error("log"); };
  try {
    SolveOnce(throwing_log);
    Require(false, "what a log throws arrives");
  } catch (const std::range_error&) {
  }
}

void Stopping() {
  const auto stop_in = [](const std::string& stage) {
    spba::Callbacks callbacks;
    callbacks.observer = [stage](const spba::Progress& progress) { return progress.stage.find(stage) != 0; };
    return spba::Solve(sphere::MakeSequence(3), sphere::MakePrior(), sphere::QuickOptions(), callbacks);
  };
  Refused(spba::Code::kInterrupted, {"stopped"}, [&] { stop_in("initialise"); });
  for (const char* const stage : {"hypothesis", "level"}) {
    Require(stop_in(stage).status() == spba::Status::kStopped, "stopped with the best so far");
  }
}

void TwoAtOnce() {
  const std::vector<double> alone = SolveOnce();
  std::vector<double> first, second;
  std::thread other([&] { first = SolveOnce(); });
  second = SolveOnce();
  other.join();
  Require(first == alone && second == alone, "two solves at once give what one gives");
}

class Sink : public google::LogSink {
 public:
  void send(google::LogSeverity, const char*, const char*, int, const google::LogMessageTime&, const char*,
            std::size_t) override {
    ++lines;
  }
  int lines = 0;
};

// After solves: glog is as the host left it.
void HostsGlog() {
  Require(!google::IsGoogleLoggingInitialized(), "glog was not set up by the library");
  google::InitGoogleLogging("host");
  Sink sink;
  google::AddLogSink(&sink);
  LOG(ERROR) << "the host's own";
  Require(sink.lines == 1, "the host's glog logs");
  SolveOnce();
  LOG(ERROR) << "the host's own, after a solve";
  Require(sink.lines >= 2, "and does after a solve");
  google::RemoveLogSink(&sink);
}

}  // namespace

int main() {
  BadFrames();
  BadPriorsAndOptions();
  Callbacks();
  Stopping();
  TwoAtOnce();
  HostsGlog();
  std::puts("all as it should be");
  return 0;
}
