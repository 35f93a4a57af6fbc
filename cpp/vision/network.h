// Running a network with OpenCV. See src/bridge/vision.rs for shapes and conventions.
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <opencv2/dnn.hpp>

#include "rust/cxx.h"

namespace spba::vision {

struct Picture;
struct NetworkInput;
struct Tensor;

class Network {
 public:
  explicit Network(cv::dnn::Net net) : net_(std::move(net)) {}
  // Every output of the network for a picture. Throws where the picture does not suit it.
  rust::Vec<Tensor> run(const Picture& picture, const NetworkInput& input);

 private:
  cv::dnn::Net net_;
};

// Throws where the file is no ONNX network that OpenCV can run.
std::unique_ptr<Network> read_network(rust::Str path);

}  // namespace spba::vision
