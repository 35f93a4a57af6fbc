#include "spba-ceres/cpp/vision/remap.h"

#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "spba-ceres/src/bridge/vision.rs.h"

namespace spba::vision {

void remap(rust::Slice<const float> source, std::size_t width, std::size_t height, std::size_t channels,
           rust::Slice<const float> map_x, rust::Slice<const float> map_y, Sampling sampling,
           rust::Slice<float> target) {
  // OpenCV's remap addresses pixels with 16 bits.
  constexpr std::size_t kLargestSide = std::numeric_limits<short>::max() - 1;
  if (width == 0 || height == 0 || width > kLargestSide || height > kLargestSide || channels == 0 ||
      channels > 4) {
    throw std::invalid_argument("image size is not supported by OpenCV's remap");
  }
  const std::size_t pixels = width * height;
  if (source.size() != pixels * channels || target.size() != source.size() || map_x.size() != pixels ||
      map_y.size() != pixels) {
    throw std::invalid_argument("image and maps differ in size");
  }
  const int rows = static_cast<int>(height), columns = static_cast<int>(width);
  const int type = CV_MAKETYPE(CV_32F, static_cast<int>(channels));
  // cv::Mat has no const view; source and maps are only read.
  const cv::Mat from(rows, columns, type, const_cast<float*>(source.data()));
  const cv::Mat x(rows, columns, CV_32F, const_cast<float*>(map_x.data()));
  const cv::Mat y(rows, columns, CV_32F, const_cast<float*>(map_y.data()));
  cv::Mat to(rows, columns, type, target.data());
  const bool linear = sampling == Sampling::Linear;
  cv::remap(from, to, x, y, linear ? cv::INTER_LINEAR : cv::INTER_NEAREST,
            linear ? cv::BORDER_REPLICATE : cv::BORDER_CONSTANT, cv::Scalar::all(0));
  if (to.data != reinterpret_cast<const unsigned char*>(target.data())) {
    throw std::logic_error("OpenCV moved the target");
  }
}

}  // namespace spba::vision
