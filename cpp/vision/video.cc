#include "spba-ceres/cpp/vision/video.h"

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>

#include "spba-ceres/cpp/vision/picture.h"
#include "spba-ceres/src/bridge/vision.rs.h"

namespace spba::vision {

bool Video::next(Picture& picture) {
  cv::Mat frame;
  if (!capture_.read(frame) || frame.empty()) return false;
  if (frame.type() != CV_8UC3) throw std::runtime_error("frames are not of 8-bit colour");
  cv::cvtColor(frame, frame, cv::COLOR_BGR2RGB);
  picture = ToPicture(frame, capture_.get(cv::CAP_PROP_POS_MSEC) / 1000.0);
  return true;
}

std::unique_ptr<Video> open_video(rust::Str path) {
  cv::VideoCapture capture(std::string(path), cv::CAP_FFMPEG);
  if (!capture.isOpened()) return nullptr;
  return std::make_unique<Video>(std::move(capture));
}

double sharpness(const Picture& picture) {
  cv::Mat gray, edges;
  cv::cvtColor(ToMat(picture), gray, cv::COLOR_RGB2GRAY);
  cv::Laplacian(gray, edges, CV_32F);
  cv::Scalar mean, deviation;
  cv::meanStdDev(edges, mean, deviation);
  return deviation[0] * deviation[0];
}

Picture resized(const Picture& picture, std::size_t width, std::size_t height) {
  cv::Mat other;
  const bool smaller = width < picture.width || height < picture.height;
  cv::resize(ToMat(picture), other, cv::Size(static_cast<int>(width), static_cast<int>(height)), 0.0, 0.0,
             smaller ? cv::INTER_AREA : cv::INTER_LINEAR);
  return ToPicture(other, picture.seconds);
}

}  // namespace spba::vision
