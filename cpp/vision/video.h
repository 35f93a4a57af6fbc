// Decoding video with OpenCV. See src/bridge/vision.rs for shapes and conventions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <opencv2/videoio.hpp>

#include "rust/cxx.h"

namespace spba::vision {

struct Picture;

class Video {
 public:
  explicit Video(cv::VideoCapture capture);
  // False at the end, or where no further frame can be decoded. RGB, upright, of square pixels.
  bool next(Picture& picture);
  // How many frames the file announces, perhaps by its duration; not positive where it does not say.
  double announced() const { return capture_.get(cv::CAP_PROP_FRAME_COUNT); }

 private:
  cv::VideoCapture capture_;
  // By which players turn the pixels before they show them; 0, 90, 180 or 270.
  int clockwise_deg_ = 0;
  // Width over height of a pixel.
  double pixel_aspect_ = 1.0;
};

// Null where the file is no video that OpenCV can decode.
std::unique_ptr<Video> open_video(rust::Str path);

// How sharp a picture is: the variance of its Laplacian, larger is sharper.
double sharpness(const Picture& picture);

// The picture at another size, averaged over what each pixel covers.
Picture resized(const Picture& picture, std::size_t width, std::size_t height);

}  // namespace spba::vision
