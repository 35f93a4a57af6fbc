// Between OpenCV's matrices and the bridge's pictures.
#pragma once

#include <algorithm>
#include <opencv2/core.hpp>
#include <stdexcept>

#include "spba-ceres/src/bridge/vision.rs.h"

namespace spba::vision {

// A view of a picture that is only read; cv::Mat has no const one.
inline cv::Mat ToMat(const Picture& picture) {
  if (picture.width == 0 || picture.height == 0 || picture.rgb.size() != 3 * picture.width * picture.height) {
    throw std::invalid_argument("picture and size differ");
  }
  return cv::Mat(static_cast<int>(picture.height), static_cast<int>(picture.width), CV_8UC3,
                 const_cast<std::uint8_t*>(picture.rgb.data()));
}

inline Picture ToPicture(const cv::Mat& rgb, double seconds) {
  Picture picture;
  picture.width = static_cast<std::size_t>(rgb.cols);
  picture.height = static_cast<std::size_t>(rgb.rows);
  picture.seconds = seconds;
  picture.rgb.reserve(3 * picture.width * picture.height);
  for (int row = 0; row < rgb.rows; ++row) {
    const std::uint8_t* pixels = rgb.ptr<std::uint8_t>(row);
    for (int i = 0; i < 3 * rgb.cols; ++i) picture.rgb.push_back(pixels[i]);
  }
  return picture;
}

// A view of a one-channel image that is only read.
inline cv::Mat ToMat(rust::Slice<const std::uint8_t> pixels, std::size_t width, std::size_t height) {
  if (width == 0 || height == 0 || pixels.size() != width * height) {
    throw std::invalid_argument("image and size differ");
  }
  return cv::Mat(static_cast<int>(height), static_cast<int>(width), CV_8U,
                 const_cast<std::uint8_t*>(pixels.data()));
}

}  // namespace spba::vision
