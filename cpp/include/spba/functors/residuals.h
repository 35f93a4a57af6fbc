// What a point is compared with, given where each camera sees it: the residuals of Eq. 4, 5 and 6 for
// ObjectCost (object_cost.h). Templated on the scalar, for autodiff over a few numbers.
#ifndef SPBA_FUNCTORS_RESIDUALS_H_
#define SPBA_FUNCTORS_RESIDUALS_H_

#include <cmath>

#include "spba/camera.h"
#include "spba/image.h"

namespace spba {
inline namespace v0 {
namespace functors {

// A point as one camera sees it.
template <typename T>
struct SeenPoint {
  T in_camera[3];   // in object diagonals
  T intrinsics[4];  // fx, fy, cx, cy in pixels of the whole image
  T alpha;          // object diagonals a unit of the off-the-shelf reconstruction
};

// pixel[2]; false behind the camera.
template <typename T>
bool Project(const SeenPoint<T>& seen, T* pixel) {
  const T* const x = seen.in_camera;
  if (!(x[2] > T(kMinDepth))) return false;
  pixel[0] = seen.intrinsics[0] * x[0] / x[2] + seen.intrinsics[2];
  pixel[1] = seen.intrinsics[1] * x[1] / x[2] + seen.intrinsics[3];
  return true;
}

// Eq. 4: residual[3] = I_a - I_b, in colour levels. Borrows the images. `scale` is 1 for images of full size,
// 0.5 for the next level of a pyramid, and so on.
struct PhotometricResidual {
  static constexpr int kViews = 2, kResiduals = 3;
  const ImageSampler* image_a;
  const ImageSampler* image_b;
  double scale = 1.0;

  template <typename T>
  bool operator()(const SeenPoint<T>* seen, T* residual) const {
    T of_a[3], of_b[3];
    if (!Colour(seen[0], *image_a, of_a) || !Colour(seen[1], *image_b, of_b)) return false;
    for (int c = 0; c < 3; ++c) residual[c] = of_a[c] - of_b[c];
    return true;
  }

 private:
  template <typename T>
  bool Colour(const SeenPoint<T>& seen, const ImageSampler& image, T* rgb) const {
    T pixel[2];
    if (!Project(seen, pixel)) return false;
    for (T& x : pixel) x *= scale;
    image.Sample(pixel, rgb);
    return true;
  }
};

// Eq. 5: residual[1] = max(0, distance to a silhouette's pixel - tolerance), in pixels (silhouette.h says
// why). Borrows the pixel, so that who finds correspondences may change it between evaluations.
struct SilhouetteResidual {
  static constexpr int kViews = 1, kResiduals = 1;
  const double* pixel;
  double tolerance;

  template <typename T>
  bool operator()(const SeenPoint<T>* seen, T* residual) const {
    using std::sqrt;
    T projected[2];
    if (!Project(*seen, projected)) return false;
    const T x = projected[0] - pixel[0], y = projected[1] - pixel[1];
    const T squared = x * x + y * y;
    const double near = tolerance + 1e-9;
    residual[0] = squared < T(near * near) ? T(0.0) : sqrt(squared) - tolerance;
    return true;
  }
};

// Eq. 6: residual[1] = d' + slope (u - pixel) - alpha / z, in inverse units of the off-the-shelf
// reconstruction (inverse_depth.h says why there is a slope).
struct InverseDepthResidual {
  static constexpr int kViews = 1, kResiduals = 1;
  double pixel[2];
  double inverse_depth;
  double slope[2];

  template <typename T>
  bool operator()(const SeenPoint<T>* seen, T* residual) const {
    T projected[2];
    if (!Project(*seen, projected)) return false;
    residual[0] = inverse_depth + slope[0] * (projected[0] - pixel[0]) +
                  slope[1] * (projected[1] - pixel[1]) - seen->alpha / seen->in_camera[2];
    return true;
  }
};

}  // namespace functors
}  // namespace v0
}  // namespace spba

#endif  // SPBA_FUNCTORS_RESIDUALS_H_
