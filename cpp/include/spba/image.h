// A colour image as a smooth function of the pixel (Sec. 1, "Notation").
#ifndef SPBA_IMAGE_H_
#define SPBA_IMAGE_H_

#include <ceres/cubic_interpolation.h>

namespace spba {

// Bicubic (Catmull-Rom) sampling: value and derivative agree everywhere, which line searches need; constant
// beyond the border. Borrows `rgb` (height x width x 3, row-major, interleaved), which must outlive it.
class ImageSampler {
 public:
  ImageSampler(const float* rgb, int width, int height)
      : grid_(rgb, 0, height, 0, width), interpolator_(grid_) {}
  // The interpolator points into grid_.
  ImageSampler(const ImageSampler&) = delete;
  ImageSampler& operator=(const ImageSampler&) = delete;

  // rgb[3] at pixel[2] = (column, row); Ceres counts from pixel centres, we count from pixel corners.
  template <typename T>
  void Sample(const T* pixel, T* rgb) const {
    interpolator_.Evaluate(pixel[1] - T(0.5), pixel[0] - T(0.5), rgb);
  }

 private:
  ceres::Grid2D<float, 3> grid_;
  ceres::BiCubicInterpolator<ceres::Grid2D<float, 3>> interpolator_;
};

}  // namespace spba

#endif  // SPBA_IMAGE_H_
