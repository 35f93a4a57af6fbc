#include "spba-ceres/cpp/vision/network.h"

#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "spba-ceres/cpp/vision/picture.h"
#include "spba-ceres/src/bridge/vision.rs.h"

namespace spba::vision {

rust::Vec<Tensor> Network::run(const Picture& picture, const NetworkInput& input) {
  const int side = static_cast<int>(input.side);
  cv::Mat square;
  cv::resize(ToMat(picture), square, cv::Size(side, side), 0.0, 0.0,
             input.side < std::max(picture.width, picture.height) ? cv::INTER_AREA : cv::INTER_LINEAR);
  square.convertTo(square, CV_32F);
  cv::subtract(square, cv::Scalar(input.mean[0], input.mean[1], input.mean[2]), square);
  cv::divide(square, cv::Scalar(input.deviation[0], input.deviation[1], input.deviation[2]), square);
  net_.setInput(cv::dnn::blobFromImage(square));
  std::vector<cv::Mat> outputs;
  net_.forward(outputs, net_.getUnconnectedOutLayersNames());
  rust::Vec<Tensor> tensors;
  for (const cv::Mat& output : outputs) {
    if (output.type() != CV_32F || !output.isContinuous()) {
      throw std::runtime_error("an output is not of 32-bit floats");
    }
    Tensor tensor;
    for (int i = 0; i < output.dims; ++i) tensor.shape.push_back(static_cast<std::size_t>(output.size[i]));
    const float* values = output.ptr<float>();
    tensor.values.reserve(output.total());
    for (std::size_t i = 0; i < output.total(); ++i) tensor.values.push_back(values[i]);
    tensors.push_back(std::move(tensor));
  }
  return tensors;
}

std::unique_ptr<Network> read_network(rust::Str path) {
  cv::dnn::Net net = cv::dnn::readNetFromONNX(std::string(path));
  net.setPreferableBackend(cv::dnn::DNN_BACKEND_OPENCV);
  net.setPreferableTarget(cv::dnn::DNN_TARGET_CPU);
  return std::make_unique<Network>(std::move(net));
}

}  // namespace spba::vision
