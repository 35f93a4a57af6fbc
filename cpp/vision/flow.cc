#include "spba-ceres/cpp/vision/flow.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <stdexcept>

#include "spba-ceres/cpp/vision/picture.h"
#include "spba-ceres/src/bridge/vision.rs.h"

namespace spba::vision {
namespace {

// What moves is found in pictures no longer than this, in pixels.
constexpr double kLongest = 200.0;

cv::Mat Gray(const Picture& picture, cv::Size size) {
  cv::Mat gray, smaller;
  cv::cvtColor(ToMat(picture), gray, cv::COLOR_RGB2GRAY);
  cv::resize(gray, smaller, size, 0.0, 0.0, cv::INTER_AREA);
  return smaller;
}

}  // namespace

rust::Vec<std::uint8_t> carried(rust::Slice<const std::uint8_t> map, const Picture& from, const Picture& to) {
  const cv::Mat values = ToMat(map, from.width, from.height);
  if (from.width != to.width || from.height != to.height) {
    throw std::invalid_argument("pictures differ in size");
  }
  const double shrunk = std::min(1.0, kLongest / static_cast<double>(std::max(values.cols, values.rows)));
  const cv::Size size(std::max(1, cvRound(values.cols * shrunk)), std::max(1, cvRound(values.rows * shrunk)));
  // Farnebäck's flow does not depend on how many threads there are, as that by inverse search does.
  cv::Mat small_flow, flow;
  cv::calcOpticalFlowFarneback(Gray(to, size), Gray(from, size), small_flow, 0.5, 4, 11, 3, 7, 1.5, 0);
  cv::resize(small_flow, flow, values.size(), 0.0, 0.0, cv::INTER_LINEAR);
  const float across = static_cast<float>(values.cols) / static_cast<float>(size.width);
  const float down = static_cast<float>(values.rows) / static_cast<float>(size.height);
  for (int row = 0; row < flow.rows; ++row) {
    for (int column = 0; column < flow.cols; ++column) {
      cv::Vec2f& place = flow.at<cv::Vec2f>(row, column);
      place[0] = place[0] * across + static_cast<float>(column);
      place[1] = place[1] * down + static_cast<float>(row);
    }
  }
  cv::Mat moved;
  cv::remap(values, moved, flow, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  rust::Vec<std::uint8_t> result;
  result.reserve(moved.total());
  for (int row = 0; row < moved.rows; ++row) {
    const std::uint8_t* pixels = moved.ptr<std::uint8_t>(row);
    for (int column = 0; column < moved.cols; ++column) result.push_back(pixels[column]);
  }
  return result;
}

}  // namespace spba::vision
