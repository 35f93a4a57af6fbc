#include "spba-ceres/cpp/vision/features.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <vector>

#include "spba-ceres/cpp/vision/picture.h"
#include "spba-ceres/src/bridge/vision.rs.h"

namespace spba::vision {
namespace {

constexpr int kEntries = 128;
// Pixels about the object that its features' surroundings reach into.
constexpr int kMargin = 16;

template <typename Point>
std::vector<Point> Points(rust::Slice<const double> entries) {
  constexpr std::size_t kSize = sizeof(Point) / sizeof(double);
  if (entries.size() % kSize != 0) throw std::invalid_argument("points of another length");
  std::vector<Point> points(entries.size() / kSize);
  for (std::size_t i = 0; i < points.size(); ++i) {
    std::copy_n(entries.data() + kSize * i, kSize, reinterpret_cast<double*>(&points[i]));
  }
  return points;
}

Found ToFound(const cv::Matx33d& rotation, const cv::Vec3d& translation) {
  Found found{};
  found.any = true;
  std::copy_n(rotation.val, 9, found.rotation.begin());
  std::copy_n(translation.val, 3, found.translation.begin());
  return found;
}

}  // namespace

rust::Vec<Feature> detect(rust::Slice<const std::uint8_t> gray, rust::Slice<const std::uint8_t> mask,
                          std::size_t width, std::size_t height, const DetectOptions& options,
                          rust::Vec<float>& descriptors) {
  const auto sift = cv::SIFT::create(static_cast<int>(options.max_features), 3, options.contrast);
  // Of the picture about the object alone: the rest costs as much and its features would count among the
  // most.
  const cv::Mat whole = ToMat(mask, width, height);
  const cv::Rect object = cv::boundingRect(whole);
  const cv::Rect box = (object + cv::Size(2 * kMargin, 2 * kMargin) - cv::Point(kMargin, kMargin)) &
                       cv::Rect(cv::Point(), whole.size());
  rust::Vec<Feature> features;
  if (object.empty()) return features;
  cv::Mat larger, where;
  cv::resize(ToMat(gray, width, height)(box), larger, cv::Size(), options.zoom, options.zoom,
             cv::INTER_CUBIC);
  cv::resize(whole(box), where, larger.size(), 0.0, 0.0, cv::INTER_NEAREST);
  std::vector<cv::KeyPoint> points;
  cv::Mat rows;
  sift->detectAndCompute(larger, where, points, rows);
  std::vector<std::size_t> order(points.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return points[a].response > points[b].response; });
  features.reserve(points.size());
  descriptors.reserve(points.size() * kEntries);
  for (const std::size_t i : order) {
    const cv::KeyPoint& point = points[i];
    features.push_back(
        {(point.pt.x + 0.5) / options.zoom + box.x, (point.pt.y + 0.5) / options.zoom + box.y});
    const float* row = rows.ptr<float>(static_cast<int>(i));
    float sum = 0.0f;
    for (int k = 0; k < kEntries; ++k) sum += row[k];
    for (int k = 0; k < kEntries; ++k) descriptors.push_back(std::sqrt(row[k] / std::max(sum, 1e-6f)));
  }
  return features;
}

Found two_views(rust::Slice<const double> a, rust::Slice<const double> b, double threshold,
                rust::Slice<std::uint8_t> inliers) {
  const auto first = Points<cv::Point2d>(a), second = Points<cv::Point2d>(b);
  if (first.size() != second.size() || inliers.size() != first.size()) {
    throw std::invalid_argument("as many points as inliers are needed in both views");
  }
  if (first.size() < 5) return Found{};
  cv::UsacParams params;
  params.confidence = 0.9999;
  params.threshold = threshold;
  params.maxIterations = 1000;
  const cv::Mat one = cv::Mat::eye(3, 3, CV_64F);
  cv::Mat mask;
  const cv::Mat essential =
      cv::findEssentialMat(first, second, one, one, cv::noArray(), cv::noArray(), mask, params);
  if (essential.rows != 3) return Found{};
  cv::Matx33d rotation;
  cv::Vec3d translation;
  cv::recoverPose(essential, first, second, cv::Mat::eye(3, 3, CV_64F), rotation, translation, mask);
  for (std::size_t i = 0; i < inliers.size(); ++i)
    inliers[i] = mask.at<std::uint8_t>(static_cast<int>(i)) != 0;
  return ToFound(rotation, translation);
}

Found resect(rust::Slice<const double> points, rust::Slice<const double> rays, double threshold,
             rust::Slice<std::uint8_t> inliers) {
  const auto space = Points<cv::Point3d>(points);
  const auto seen = Points<cv::Point2d>(rays);
  if (space.size() != seen.size() || inliers.size() != space.size()) {
    throw std::invalid_argument("as many points as rays and inliers are needed");
  }
  std::fill(inliers.begin(), inliers.end(), std::uint8_t{0});
  if (space.size() < 6) return Found{};
  cv::Vec3d turn, translation;
  std::vector<int> chosen;
  const bool found =
      cv::solvePnPRansac(space, seen, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), turn, translation, false,
                         2000, static_cast<float>(threshold), 0.9999, chosen, cv::SOLVEPNP_EPNP);
  if (!found) return Found{};
  for (const int index : chosen) inliers[static_cast<std::size_t>(index)] = 1;
  cv::Matx33d rotation;
  cv::Rodrigues(turn, rotation);
  return ToFound(rotation, translation);
}

}  // namespace spba::vision
