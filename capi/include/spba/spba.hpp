// libspba in C++17: RAII, exceptions and views over spba.h, which says what everything means. Header-only;
// link libspba.
//
//   spba::Sequence sequence;
//   for (...) sequence.Add({name, image, mask, camera, cam_from_world, depth});
//   const spba::Prior prior = spba::Prior::Load("car.safetensors");
//   const spba::Solution solution = spba::Solve(sequence, prior);
#ifndef SPBA_SPBA_HPP_
#define SPBA_SPBA_HPP_

#include <array>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "spba/pinhole.h"
#include "spba/spba.h"

namespace spba {
inline namespace v0 {

enum class Code : spba_code {
  kInvalidInput = SPBA_INVALID_INPUT,
  kInvalidPrior = SPBA_INVALID_PRIOR,
  kInvalidOptions = SPBA_INVALID_OPTIONS,
  kInterrupted = SPBA_INTERRUPTED,
  kNoSolution = SPBA_NO_SOLUTION,
  kNotThere = SPBA_NOT_THERE,
  kInternal = SPBA_INTERNAL,
};

// What the library refuses, or cannot do: one line that names it and how to mend it.
class Error : public std::runtime_error {
 public:
  Error(Code code, const std::string& message) : std::runtime_error(message), code_(code) {}
  Code code() const noexcept { return code_; }

 private:
  Code code_;
};

namespace internal {

inline void Check(spba_code code) {
  if (code != SPBA_OK) throw Error(static_cast<Code>(code), spba_error_message());
}

template <typename T, void (*kFree)(T*)>
struct Deleter {
  void operator()(T* handle) const noexcept { kFree(handle); }
};

template <typename T, void (*kFree)(T*)>
using Handle = std::unique_ptr<T, Deleter<T, kFree>>;

template <typename Struct>
Struct Sized() {
  Struct sized{};
  sized.struct_size = static_cast<std::uint32_t>(sizeof(Struct));
  return sized;
}

}  // namespace internal

// A view of `count` entries; valid as long as whoever gave it.
template <typename T>
class View {
 public:
  View() = default;
  View(const T* data, std::size_t count) : data_(data), count_(count) {}
  const T* data() const { return data_; }
  std::size_t size() const { return count_; }
  bool empty() const { return count_ == 0; }
  const T* begin() const { return data_; }
  const T* end() const { return data_ + count_; }
  const T& operator[](std::size_t i) const { return data_[i]; }

 private:
  const T* data_ = nullptr;
  std::size_t count_ = 0;
};

// A borrowed picture, mask or depth map; `row_stride` in bytes, 0 = rows without gaps.
class Raster {
 public:
  // Nothing: the library refuses it where it needs a picture.
  Raster() = default;
  // Three channels, 0 to 255.
  static Raster Rgb(const std::uint8_t* data, std::uint32_t width, std::uint32_t height,
                    std::size_t row_stride = 0) {
    return {SPBA_RGB_U8, data, width, height, row_stride, 3};
  }
  static Raster Bgr(const std::uint8_t* data, std::uint32_t width, std::uint32_t height,
                    std::size_t row_stride = 0) {
    return {SPBA_BGR_U8, data, width, height, row_stride, 3};
  }
  static Raster Rgb(const float* data, std::uint32_t width, std::uint32_t height,
                    std::size_t row_stride = 0) {
    return {SPBA_RGB_F32, data, width, height, row_stride, 3 * sizeof(float)};
  }
  // One channel.
  static Raster Grey(const std::uint8_t* data, std::uint32_t width, std::uint32_t height,
                     std::size_t row_stride = 0) {
    return {SPBA_GREY_U8, data, width, height, row_stride, 1};
  }
  static Raster Grey(const float* data, std::uint32_t width, std::uint32_t height,
                     std::size_t row_stride = 0) {
    return {SPBA_GREY_F32, data, width, height, row_stride, sizeof(float)};
  }

  // Null where there is nothing.
  const spba_raster* c() const { return raster_.data == nullptr ? nullptr : &raster_; }

 private:
  Raster(spba_format format, const void* data, std::uint32_t width, std::uint32_t height,
         std::size_t row_stride, std::size_t pixel_bytes)
      : raster_(internal::Sized<spba_raster>()) {
    raster_.format = format;
    raster_.data = data;
    raster_.width = width;
    raster_.height = height;
    raster_.row_stride = row_stride == 0 ? width * pixel_bytes : row_stride;
  }

  spba_raster raster_{};
};

// b_from_a: x_b = R x_a + t. The quaternion is of unit length, its real part first.
struct Rigid3 {
  std::array<double, 4> quaternion_wxyz{1.0, 0.0, 0.0, 0.0};
  std::array<double, 3> translation{0.0, 0.0, 0.0};
};

// b_from_a: x_b = scale R x_a + t.
struct Sim3 {
  double scale = 1.0;
  std::array<double, 4> quaternion_wxyz{1.0, 0.0, 0.0, 0.0};
  std::array<double, 3> translation{0.0, 0.0, 0.0};
};

struct Frame {
  std::string name;                        // each once
  Raster image;                            // three channels, undistorted
  Raster mask;                             // one channel: the object is above 127 (u8) or above 0.5 (f32)
  Pinhole camera{};                        // pixels
  std::optional<Rigid3> cam_from_world{};  // COLMAP's convention, in the host's units
  Raster depth{};  // one channel of f32: z in units of the poses, 0 = unknown; may be left out
};

// The frames, copied.
class Sequence {
 public:
  Sequence() {
    spba_sequence* made = nullptr;
    internal::Check(spba_sequence_new(&made));
    handle_.reset(made);
  }

  // Throws Error, which names the frame.
  void Add(const Frame& frame) {
    spba_pose pose{};
    spba_frame given = internal::Sized<spba_frame>();
    given.name = frame.name.c_str();
    given.image = frame.image.c();
    given.mask = frame.mask.c();
    given.depth = frame.depth.c();
    given.fx = frame.camera.fx;
    given.fy = frame.camera.fy;
    given.cx = frame.camera.cx;
    given.cy = frame.camera.cy;
    if (frame.cam_from_world) {
      for (std::size_t i = 0; i < 4; ++i) pose.quaternion_wxyz[i] = frame.cam_from_world->quaternion_wxyz[i];
      for (std::size_t i = 0; i < 3; ++i) pose.translation[i] = frame.cam_from_world->translation[i];
      given.cam_from_world = &pose;
    }
    internal::Check(spba_sequence_add_frame(handle_.get(), &given));
  }

  const spba_sequence* c() const { return handle_.get(); }

 private:
  internal::Handle<spba_sequence, spba_sequence_free> handle_;
};

// A shape prior; may be used from any number of threads.
class Prior {
 public:
  static Prior Load(const std::string& path) {
    spba_prior* made = nullptr;
    internal::Check(spba_prior_load(path.c_str(), &made));
    return Prior(made);
  }

  // X(s) = mean + basis s. `mean` has 3 N entries, `basis` 3 N rows of `style_count`, `normals` 3 N.
  static Prior Linear(const std::vector<double>& mean, const std::vector<double>& basis,
                      std::uint32_t style_count, const std::vector<double>& normals) {
    if (mean.size() % 3 != 0 || basis.size() != mean.size() * style_count || normals.size() != mean.size()) {
      throw Error(Code::kInvalidPrior, "the linear prior: mean has " + std::to_string(mean.size()) +
                                           " entries, basis " + std::to_string(basis.size()) +
                                           " and normals " + std::to_string(normals.size()) + ", for " +
                                           std::to_string(style_count) +
                                           " styles; give 3 N, 3 N style_count and 3 N of them");
    }
    spba_linear_prior arrays = internal::Sized<spba_linear_prior>();
    arrays.point_count = static_cast<std::uint32_t>(mean.size() / 3);
    arrays.style_count = style_count;
    arrays.mean = mean.data();
    arrays.basis = basis.data();
    arrays.normals = normals.data();
    spba_prior* made = nullptr;
    internal::Check(spba_prior_linear(&arrays, &made));
    return Prior(made);
  }

  std::size_t style_count() const { return spba_prior_style_count(handle_.get()); }
  std::size_t point_count() const { return spba_prior_point_count(handle_.get()); }
  bool is_linear() const { return spba_prior_is_linear(handle_.get()) != 0; }

  // X(s) of the first points.size() / 3 points, and its derivative by s: rows of style_count(), one an entry
  // of `points`. `jacobian` may be null.
  void Evaluate(const std::vector<double>& style, std::vector<double>* points,
                std::vector<double>* jacobian = nullptr) const {
    if (style.size() != style_count()) {
      throw Error(Code::kInvalidInput, "style: it has " + std::to_string(style.size()) +
                                           " entries, the prior " + std::to_string(style_count()) +
                                           "; give as many");
    }
    if (jacobian != nullptr) jacobian->resize(points->size() * style.size());
    internal::Check(spba_prior_evaluate(handle_.get(), style.data(),
                                        static_cast<std::uint32_t>(points->size() / 3), points->data(),
                                        jacobian == nullptr ? nullptr : jacobian->data()));
  }

  // From the frame of X(s) to the object frame; none where they are the same (spba.h).
  std::optional<Sim3> CanonicalFromShape(const std::vector<double>& style) const {
    if (style.size() != style_count()) throw Error(Code::kInvalidInput, "style: give one number a style");
    spba_similarity similarity{};
    const spba_code code = spba_prior_canonical_from_shape(handle_.get(), style.data(), &similarity);
    if (code == SPBA_NOT_THERE) return std::nullopt;
    internal::Check(code);
    Sim3 sim3;
    sim3.scale = similarity.scale;
    for (std::size_t i = 0; i < 4; ++i) sim3.quaternion_wxyz[i] = similarity.quaternion_wxyz[i];
    for (std::size_t i = 0; i < 3; ++i) sim3.translation[i] = similarity.translation[i];
    return sim3;
  }

  const spba_prior* c() const { return handle_.get(); }

 private:
  explicit Prior(spba_prior* handle) : handle_(handle) {}
  internal::Handle<spba_prior, spba_prior_free> handle_;
};

// The defaults, or what a TOML text says over them.
class Options {
 public:
  Options() = default;
  static Options FromToml(const std::string& toml) {
    spba_options* made = nullptr;
    internal::Check(spba_options_from_toml(toml.c_str(), &made));
    Options options;
    options.handle_.reset(made);
    return options;
  }

  const spba_options* c() const { return handle_.get(); }

 private:
  internal::Handle<spba_options, spba_options_free> handle_;
};

struct Progress {
  std::string stage;
  std::uint32_t step, iteration;
  double objective;  // not a number while initialising
  double seconds;
};

enum class LogLevel : spba_log_level {
  kDebug = SPBA_LOG_DEBUG,
  kInfo = SPBA_LOG_INFO,
  kWarning = SPBA_LOG_WARNING,
  kError = SPBA_LOG_ERROR,
};

// Called from threads of the library, one at a time. What they throw ends the solve, and Solve throws it.
struct Callbacks {
  std::function<bool(const Progress&)> observer{};  // false stops the solve
  std::function<void(LogLevel, const std::string&)> log{};
};

enum class Status : spba_status {
  kBelowThreshold = SPBA_BELOW_THRESHOLD,
  kConverged = SPBA_CONVERGED,
  kStepLimit = SPBA_STEP_LIMIT,
  kStopped = SPBA_STOPPED,
};

class Solution {
 public:
  // Takes the handle over.
  explicit Solution(spba_solution* handle) : handle_(handle), summary_(internal::Sized<spba_summary>()) {
    internal::Check(spba_solution_summary(handle_.get(), &summary_));
  }

  Status status() const { return static_cast<Status>(summary_.status); }
  std::size_t frame_count() const { return summary_.frame_count; }
  std::size_t iterations() const { return summary_.iterations; }
  double objective_start() const { return summary_.objective_start; }
  double objective_end() const { return summary_.objective_end; }
  // Object diagonals a unit of the host's poses and depths.
  double alpha() const { return summary_.alpha; }
  // By which all focal lengths were multiplied.
  double focal_factor() const { return summary_.focal_factor; }

  // Of the frame added as the `frame`-th, counted from 0; translation in object diagonals.
  Rigid3 cam_from_object(std::size_t frame) const {
    spba_pose pose{};
    internal::Check(spba_solution_cam_from_object(handle_.get(), static_cast<std::uint32_t>(frame), &pose));
    Rigid3 rigid;
    for (std::size_t i = 0; i < 4; ++i) rigid.quaternion_wxyz[i] = pose.quaternion_wxyz[i];
    for (std::size_t i = 0; i < 3; ++i) rigid.translation[i] = pose.translation[i];
    return rigid;
  }
  double silhouette_iou(std::size_t frame) const {
    double iou = 0.0;
    internal::Check(spba_solution_silhouette_iou(handle_.get(), static_cast<std::uint32_t>(frame), &iou));
    return iou;
  }
  // None where no frame had a pose.
  std::optional<Sim3> object_from_world() const {
    spba_similarity similarity{};
    const spba_code code = spba_solution_object_from_world(handle_.get(), &similarity);
    if (code == SPBA_NOT_THERE) return std::nullopt;
    internal::Check(code);
    Sim3 sim3;
    sim3.scale = similarity.scale;
    for (std::size_t i = 0; i < 4; ++i) sim3.quaternion_wxyz[i] = similarity.quaternion_wxyz[i];
    for (std::size_t i = 0; i < 3; ++i) sim3.translation[i] = similarity.translation[i];
    return sim3;
  }

  View<double> style() const { return {spba_solution_style(handle_.get()), summary_.style_count}; }
  View<double> free_form() const {
    return {spba_solution_free_form(handle_.get()), summary_.free_form_count};
  }
  // xyz after xyz, object frame.
  View<double> points() const {
    return {spba_solution_points(handle_.get()), 3 * std::size_t{summary_.point_count}};
  }
  View<double> normals() const {
    return {spba_solution_normals(handle_.get()), 3 * std::size_t{summary_.point_count}};
  }
  // Three indices of points a face.
  View<std::uint32_t> faces() const {
    return {spba_solution_faces(handle_.get()), 3 * std::size_t{summary_.face_count}};
  }

 private:
  internal::Handle<spba_solution, spba_solution_free> handle_;
  spba_summary summary_;
};

namespace internal {

// The host's functions, and what one of them threw.
struct Called {
  const Callbacks* callbacks;
  std::mutex mutex;
  std::exception_ptr thrown;

  template <typename Call>
  bool Guard(Call call) noexcept {
    try {
      return call();
    } catch (...) {
      const std::lock_guard<std::mutex> lock(mutex);
      if (!thrown) thrown = std::current_exception();
      return false;
    }
  }

  bool failed() {
    const std::lock_guard<std::mutex> lock(mutex);
    return thrown != nullptr;
  }
};

extern "C" inline std::int32_t SpbaObserve(void* user, const spba_progress* progress) {
  Called* const called = static_cast<Called*>(user);
  if (called->failed()) return 0;
  return called->Guard([&] {
    return !called->callbacks->observer ||
           called->callbacks->observer({progress->stage, progress->step, progress->iteration,
                                        progress->objective, progress->seconds});
  });
}

extern "C" inline void SpbaLog(void* user, spba_log_level level, const char* message) {
  Called* const called = static_cast<Called*>(user);
  called->Guard([&] {
    called->callbacks->log(static_cast<LogLevel>(level), message);
    return true;
  });
}

}  // namespace internal

// Throws Error, or what a callback threw.
inline Solution Solve(const Sequence& sequence, const Prior& prior, const Options& options = {},
                      const Callbacks& callbacks = {}) {
  internal::Called called{&callbacks, {}, nullptr};
  spba_callbacks given = internal::Sized<spba_callbacks>();
  // Also there for a log that throws.
  if (callbacks.observer || callbacks.log) given.observer = internal::SpbaObserve;
  given.observer_user = &called;
  if (callbacks.log) given.log = internal::SpbaLog;
  given.log_user = &called;
  spba_solution* made = nullptr;
  const spba_code code = spba_solve(sequence.c(), prior.c(), options.c(), &given, &made);
  internal::Handle<spba_solution, spba_solution_free> owned(made);
  if (called.thrown) std::rethrow_exception(called.thrown);
  internal::Check(code);
  return Solution(owned.release());
}

using ComparedPoint = spba_compared_point;
using KnownInverseDepth = spba_known_inverse_depth;
using SilhouetteMatches = spba_silhouette_matches;
using Weights = spba_weights;

// Where the host's problem stands.
struct Estimate {
  std::vector<Rigid3> cam_from_object;  // one a frame
  std::vector<double> style;
  double alpha = 1.0;
};

// What a problem of the host's own compares, and with what weight (spba.h). Keeps what it needs of the
// sequence.
class Correspondences {
 public:
  Correspondences(const Sequence& sequence, const Prior& prior, const Options& options,
                  const Estimate& estimate)
      : frame_count_(estimate.cam_from_object.size()), style_count_(prior.style_count()) {
    spba_correspondences* made = nullptr;
    CheckSize(estimate);
    internal::Check(spba_correspondences_new(sequence.c(), prior.c(), options.c(), Poses(estimate).data(),
                                             estimate.style.data(), estimate.alpha, &made));
    handle_.reset(made);
  }

  // All anew.
  void Update(const Estimate& estimate) {
    CheckSize(estimate);
    internal::Check(spba_correspondences_update(handle_.get(), Poses(estimate).data(), estimate.style.data(),
                                                estimate.alpha));
  }
  // The silhouettes' matches alone; lists keep their lengths and places.
  void Rematch(const Estimate& estimate) {
    CheckSize(estimate);
    internal::Check(spba_correspondences_rematch(handle_.get(), Poses(estimate).data(), estimate.style.data(),
                                                 estimate.alpha));
  }

  Weights weights() const {
    Weights weights = internal::Sized<Weights>();
    internal::Check(spba_correspondences_weights(handle_.get(), &weights));
    return weights;
  }
  View<ComparedPoint> compared() const {
    const ComparedPoint* data = nullptr;
    std::size_t count = 0;
    internal::Check(spba_correspondences_compared(handle_.get(), &data, &count));
    return {data, count};
  }
  View<KnownInverseDepth> inverse_depths() const {
    const KnownInverseDepth* data = nullptr;
    std::size_t count = 0;
    internal::Check(spba_correspondences_inverse_depths(handle_.get(), &data, &count));
    return {data, count};
  }
  SilhouetteMatches silhouette(std::size_t frame) const {
    SilhouetteMatches matches = internal::Sized<SilhouetteMatches>();
    internal::Check(
        spba_correspondences_silhouette(handle_.get(), static_cast<std::uint32_t>(frame), &matches));
    return matches;
  }

 private:
  void CheckSize(const Estimate& estimate) const {
    if (estimate.cam_from_object.size() != frame_count_ || estimate.style.size() != style_count_) {
      throw Error(Code::kInvalidInput, "estimate: it has " + std::to_string(estimate.cam_from_object.size()) +
                                           " poses and " + std::to_string(estimate.style.size()) +
                                           " styles; give " + std::to_string(frame_count_) + " and " +
                                           std::to_string(style_count_));
    }
  }
  static std::vector<spba_pose> Poses(const Estimate& estimate) {
    std::vector<spba_pose> poses(estimate.cam_from_object.size());
    for (std::size_t l = 0; l < poses.size(); ++l) {
      const Rigid3& pose = estimate.cam_from_object[l];
      for (std::size_t i = 0; i < 4; ++i) poses[l].quaternion_wxyz[i] = pose.quaternion_wxyz[i];
      for (std::size_t i = 0; i < 3; ++i) poses[l].translation[i] = pose.translation[i];
    }
    return poses;
  }

  std::size_t frame_count_, style_count_;
  internal::Handle<spba_correspondences, spba_correspondences_free> handle_;
};

}  // namespace v0
}  // namespace spba

#endif  // SPBA_SPBA_HPP_
