// The Ceres problem of Eq. 9 from flat arrays: what Rust sees of C++.
#ifndef SPBA_PROBLEM_H_
#define SPBA_PROBLEM_H_

#include <memory>
#include <optional>
#include <vector>

#include "objective.h"
#include "rust/cxx.h"

namespace spba {

struct ProblemOptions;
struct Camera;
struct Silhouette;
struct SeenDepth;
struct InputMotion;
struct SolveOptions;
struct Summary;
struct Terms;
struct PriorCallback;
struct Observer;

// Every method throws std::invalid_argument where sizes or indices do not fit, which the bridge turns into
// an error. Setters may be called again between solves; variables are kept.
class Problem {
 public:
  Problem(const ProblemOptions& options, Prior prior);
  ~Problem();

  void set_camera(size_t frame, const Camera& camera);
  void set_image(size_t frame, uint32_t width, uint32_t height, rust::Slice<const float> rgb,
                 const Camera& camera);
  void set_silhouette(size_t frame, const Silhouette& silhouette);
  void set_photometric(size_t frame, rust::Slice<const uint32_t> points,
                       rust::Slice<const uint8_t> directions);
  void set_inverse_depth(size_t frame, rust::Slice<const SeenDepth> seen);
  void set_motion(size_t frame, const InputMotion& motion);
  void set_alpha(double alpha);
  double alpha() const;
  void set_variables(rust::Slice<const double> target_from_object, rust::Slice<const double> motion,
                     rust::Slice<const double> style);
  void get_variables(rust::Slice<double> target_from_object, rust::Slice<double> motion,
                     rust::Slice<double> style) const;

  Terms evaluate();
  void gradient(rust::Slice<double> gradient);
  Summary solve(const SolveOptions& options, Observer& observer);

 private:
  struct Photometric {
    Pinhole camera;
    std::vector<float> rgb;
    std::unique_ptr<ImageSampler> image;
    PhotometricError error;  // against the target frame
    std::vector<uint32_t> points;
    std::vector<uint8_t> directions;
  };
  struct InverseDepth {
    std::vector<uint32_t> points;
    std::vector<InverseDepthError> errors;
  };
  struct SilhouetteWeights {
    double pixel, point;
  };

  void CheckFrame(size_t frame) const;
  void CheckPoints(rust::Slice<const uint32_t> points) const;
  void Changed();
  // Brings objective and state up to date with the inputs; throws where that is impossible.
  void Prepare(bool with_jacobian);
  Terms CurrentTerms() const;

  Weights weights_;
  State state_;
  std::vector<Photometric> photometric_;
  std::vector<InverseDepth> inverse_depth_;
  std::vector<SilhouetteWeights> silhouette_weights_;
  std::vector<std::optional<MotionError>> motion_;
  std::unique_ptr<Objective> objective_;  // null when the inputs changed
};

std::unique_ptr<Problem> new_problem(const ProblemOptions& options, rust::Box<PriorCallback> prior);

}  // namespace spba

#endif  // SPBA_PROBLEM_H_
