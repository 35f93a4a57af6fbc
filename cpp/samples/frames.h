// Reads a folder of frames: frames.txt has a line a frame,
//   name fx fy cx cy qw qx qy qz tx ty tz
// (cam_from_world, as COLMAP has it) with name.ppm, name_mask.pgm and name_depth.pfm beside it.
#ifndef SPBA_SAMPLES_FRAMES_H_
#define SPBA_SAMPLES_FRAMES_H_

#include <array>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "rasters.h"
#include "spba/pinhole.h"

namespace samples {

struct Frame {
  std::string name;
  spba::Pinhole camera{};
  std::array<double, 4> quaternion_wxyz{};
  std::array<double, 3> translation{};
  Picture<std::uint8_t> image, mask;
  Picture<float> depth;
};

inline std::vector<Frame> ReadFrames(const std::string& folder) {
  std::ifstream list(folder + "/frames.txt");
  std::vector<Frame> frames;
  for (std::string line; std::getline(list, line);) {
    std::istringstream fields(line);
    Frame frame;
    auto& q = frame.quaternion_wxyz;
    auto& t = frame.translation;
    fields >> frame.name >> frame.camera.fx >> frame.camera.fy >> frame.camera.cx >> frame.camera.cy;
    fields >> q[0] >> q[1] >> q[2] >> q[3] >> t[0] >> t[1] >> t[2];
    if (!fields) throw std::runtime_error(folder + "/frames.txt: twelve fields a line are needed: " + line);
    const std::string base = folder + "/" + frame.name;
    frame.image = ReadPpm(base + ".ppm");
    frame.mask = ReadPgm(base + "_mask.pgm");
    frame.depth = ReadPfm(base + "_depth.pfm");
    frames.push_back(std::move(frame));
  }
  if (frames.empty()) throw std::runtime_error(folder + "/frames.txt: no frame in it");
  return frames;
}

}  // namespace samples

#endif  // SPBA_SAMPLES_FRAMES_H_
