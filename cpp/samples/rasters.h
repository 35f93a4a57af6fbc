// Pictures as netpbm files have them (P6 PPM, P5 PGM) and depth as PFM, little-endian, one channel: what the
// samples read. A host has its own.
#ifndef SPBA_SAMPLES_RASTERS_H_
#define SPBA_SAMPLES_RASTERS_H_

#include <cstdint>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace samples {

template <typename T>
struct Picture {
  std::uint32_t width = 0, height = 0;
  std::vector<T> data;  // row by row from the top
};

// `magic` and `channels` must be the file's.
template <typename T>
Picture<T> ReadPicture(const std::string& path, const std::string& magic, std::size_t channels) {
  std::ifstream file(path, std::ios::binary);
  std::string found, most;
  Picture<T> picture;
  file >> found >> picture.width >> picture.height >> most;
  file.get();
  if (!file || found != magic) throw std::runtime_error(path + ": no " + magic + " picture");
  const std::size_t row = picture.width * channels;
  picture.data.resize(row * picture.height);
  for (std::size_t y = 0; y < picture.height; ++y) {
    // PFM starts at the bottom.
    const std::size_t at = magic == "Pf" ? picture.height - 1 - y : y;
    file.read(reinterpret_cast<char*>(&picture.data[at * row]),
              static_cast<std::streamsize>(row * sizeof(T)));
  }
  if (!file) throw std::runtime_error(path + ": it ends too early");
  return picture;
}

inline Picture<std::uint8_t> ReadPpm(const std::string& path) {
  return ReadPicture<std::uint8_t>(path, "P6", 3);
}
inline Picture<std::uint8_t> ReadPgm(const std::string& path) {
  return ReadPicture<std::uint8_t>(path, "P5", 1);
}
inline Picture<float> ReadPfm(const std::string& path) { return ReadPicture<float>(path, "Pf", 1); }

}  // namespace samples

#endif  // SPBA_SAMPLES_RASTERS_H_
