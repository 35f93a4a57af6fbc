#include "spba-ceres/cpp/vision/video.h"

#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>

#include "spba-ceres/cpp/vision/picture.h"
#include "spba-ceres/src/bridge/vision.rs.h"

namespace spba::vision {

namespace {

// What OpenCV tells of a display matrix: clockwise, but for one version that has the sign wrong.
int ClockwiseDegrees(const cv::VideoCapture& capture) {
  const int told = static_cast<int>(std::lround(capture.get(cv::CAP_PROP_ORIENTATION_META)));
  const bool turned_over = CV_VERSION_MAJOR == 4 && CV_VERSION_MINOR == 6;
  return (((turned_over ? -told : told) % 360) + 360) % 360;
}

void Turn(int clockwise_deg, cv::Mat& frame) {
  switch (clockwise_deg) {
    case 90:
      cv::rotate(frame, frame, cv::ROTATE_90_CLOCKWISE);
      break;
    case 180:
      cv::rotate(frame, frame, cv::ROTATE_180);
      break;
    case 270:
      cv::rotate(frame, frame, cv::ROTATE_90_COUNTERCLOCKWISE);
      break;
    default:
      break;
  }
}

}  // namespace

Video::Video(cv::VideoCapture capture) : capture_(std::move(capture)) {
  // OpenCV 4.6 turns the wrong way, so it is done here.
  capture_.set(cv::CAP_PROP_ORIENTATION_AUTO, 0);
  clockwise_deg_ = ClockwiseDegrees(capture_);
  const double width = capture_.get(cv::CAP_PROP_SAR_NUM), height = capture_.get(cv::CAP_PROP_SAR_DEN);
  // 0 : 1 where the file does not say.
  if (width > 0 && height > 0) pixel_aspect_ = width / height;
}

bool Video::next(Picture& picture) {
  cv::Mat frame;
  if (!capture_.read(frame) || frame.empty()) return false;
  if (frame.type() != CV_8UC3) throw std::runtime_error("frames are not of 8-bit colour");
  cv::cvtColor(frame, frame, cv::COLOR_BGR2RGB);
  if (pixel_aspect_ > 1.0) {
    cv::resize(frame, frame, cv::Size(), pixel_aspect_, 1.0, cv::INTER_LINEAR);
  } else if (pixel_aspect_ < 1.0) {
    cv::resize(frame, frame, cv::Size(), 1.0, 1.0 / pixel_aspect_, cv::INTER_LINEAR);
  }
  Turn(clockwise_deg_, frame);
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
