#include "spba-ceres/cpp/vision/segment.h"

#include <opencv2/imgproc.hpp>

#include "spba-ceres/cpp/vision/picture.h"
#include "spba-ceres/src/bridge/vision.rs.h"

namespace spba::vision {
namespace {

// Writes through: the mask is the caller's.
cv::Mat Writable(rust::Slice<std::uint8_t> mask, std::size_t width, std::size_t height) {
  return ToMat({mask.data(), mask.size()}, width, height);
}

cv::Mat Disc(int radius) {
  return cv::getStructuringElement(cv::MORPH_ELLIPSE, cv::Size(2 * radius + 1, 2 * radius + 1));
}

void Copy(const cv::Mat& from, rust::Vec<double>& to) {
  to.clear();
  for (int i = 0; i < from.cols; ++i) to.push_back(from.at<double>(0, i));
}

cv::Mat Model(const rust::Vec<double>& entries) {
  cv::Mat model;
  if (!entries.empty())
    model = cv::Mat(1, static_cast<int>(entries.size()), CV_64F, const_cast<double*>(entries.data())).clone();
  return model;
}

}  // namespace

void grab_cut(const Picture& picture, rust::Slice<std::uint8_t> labels, Colours& colours, bool learn,
              std::size_t iterations) {
  cv::Mat mask = Writable(labels, picture.width, picture.height);
  cv::Mat background = Model(colours.background), object = Model(colours.object);
  cv::grabCut(ToMat(picture), mask, cv::Rect(), background, object, static_cast<int>(iterations),
              learn ? cv::GC_INIT_WITH_MASK : cv::GC_EVAL);
  Copy(background, colours.background);
  Copy(object, colours.object);
}

void clean(rust::Slice<std::uint8_t> mask, std::size_t width, std::size_t height, std::size_t radius) {
  cv::Mat whole = Writable(mask, width, height);
  cv::Mat opened;
  cv::morphologyEx(whole, opened, cv::MORPH_OPEN, Disc(static_cast<int>(radius)));
  cv::Mat labels, stats, centroids;
  const int count = cv::connectedComponentsWithStats(opened, labels, stats, centroids, 8);
  int largest = 0;
  for (int label = 1; label < count; ++label) {
    if (largest == 0 || stats.at<int>(label, cv::CC_STAT_AREA) > stats.at<int>(largest, cv::CC_STAT_AREA))
      largest = label;
  }
  if (largest == 0) {
    whole.setTo(0);
    return;
  }
  // Holes: what the outer contour encloses.
  std::vector<std::vector<cv::Point>> contours;
  cv::findContours(labels == largest, contours, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
  whole.setTo(0);
  cv::drawContours(whole, contours, -1, cv::Scalar(1), cv::FILLED);
}

rust::Vec<std::uint16_t> parts(rust::Slice<const std::uint8_t> mask, std::size_t width, std::size_t height,
                               std::size_t radius) {
  const cv::Mat whole = ToMat(mask, width, height);
  const cv::Mat disc = Disc(static_cast<int>(radius));
  cv::Mat opened, labels, spread;
  cv::morphologyEx(whole, opened, cv::MORPH_OPEN, disc);
  cv::connectedComponents(opened, labels, 8, CV_16U);
  // Corners that opening cut off belong to the part that they are next to.
  cv::dilate(labels, spread, disc);
  spread.setTo(0, whole == 0);
  rust::Vec<std::uint16_t> result;
  result.reserve(spread.total());
  for (int row = 0; row < spread.rows; ++row) {
    const std::uint16_t* pixels = spread.ptr<std::uint16_t>(row);
    for (int column = 0; column < spread.cols; ++column) result.push_back(pixels[column]);
  }
  return result;
}

void grow(rust::Slice<std::uint8_t> mask, std::size_t width, std::size_t height, std::int32_t by) {
  cv::Mat whole = Writable(mask, width, height);
  cv::Mat grown;
  if (by > 0) cv::dilate(whole, grown, Disc(by));
  if (by < 0) cv::erode(whole, grown, Disc(-by));
  if (by != 0) grown.copyTo(whole);
}

}  // namespace spba::vision
