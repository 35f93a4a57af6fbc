// Refines the cameras of a COLMAP model with the shape prior of what it shows, and writes it back:
//   colmap_refine MODEL IMAGES MASKS PRIOR.safetensors OUT
// MODEL holds cameras.txt, images.txt and points3D.txt (PINHOLE or SIMPLE_PINHOLE: run image_undistorter
// before); IMAGES the pictures by their names in images.txt, as PPM; MASKS a PGM for each, NAME with .pgm for
// .ppm. OUT must exist. Cameras keep COLMAP's world and unit; the points are copied as they are: triangulate
// anew with point_triangulator. Also writes OUT/object.txt, how the object lies in the world.
#include <cstdio>
#include <iostream>
#include <map>
#include <sstream>

#include "rasters.h"
#include "spba/spba.hpp"

namespace {

using spba::Rigid3;
using spba::Sim3;
using Vector3 = std::array<double, 3>;
using Quaternion = std::array<double, 4>;  // w x y z

Quaternion Times(const Quaternion& a, const Quaternion& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
          a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
          a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

Vector3 Rotate(const Quaternion& q, const Vector3& x) {
  const Quaternion turned = Times(Times(q, {0.0, x[0], x[1], x[2]}), {q[0], -q[1], -q[2], -q[3]});
  return {turned[1], turned[2], turned[3]};
}

// cam_from_world in the world's unit: x_cam = (R_co (s R_ow x + t_ow) + t_co) / s.
Rigid3 CamFromWorld(const Rigid3& cam_from_object, const Sim3& object_from_world) {
  Rigid3 pose;
  pose.quaternion_wxyz = Times(cam_from_object.quaternion_wxyz, object_from_world.quaternion_wxyz);
  pose.translation = Rotate(cam_from_object.quaternion_wxyz, object_from_world.translation);
  for (std::size_t i = 0; i < 3; ++i) {
    pose.translation[i] = (pose.translation[i] + cam_from_object.translation[i]) / object_from_world.scale;
  }
  return pose;
}

struct Image {
  std::string id, camera_id, name, observations;
  Rigid3 cam_from_world;
};

std::ifstream Open(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error(path + ": cannot be read");
  return file;
}

std::map<std::string, spba::Pinhole> ReadCameras(const std::string& path) {
  std::ifstream file = Open(path);
  std::map<std::string, spba::Pinhole> cameras;
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream fields(line);
    std::string id, model;
    double width = 0, height = 0;
    spba::Pinhole camera{};
    fields >> id >> model >> width >> height >> camera.fx;
    camera.fy = camera.fx;
    if (model == "PINHOLE") fields >> camera.fy;
    fields >> camera.cx >> camera.cy;
    if (!fields || (model != "PINHOLE" && model != "SIMPLE_PINHOLE")) {
      throw std::runtime_error(path + ": camera " + id + " of model " + model +
                               ": give PINHOLE or SIMPLE_PINHOLE");
    }
    cameras[id] = camera;
  }
  return cameras;
}

std::vector<Image> ReadImages(const std::string& path) {
  std::ifstream file = Open(path);
  std::vector<Image> images;
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream fields(line);
    Image image;
    fields >> image.id;
    for (double& x : image.cam_from_world.quaternion_wxyz) fields >> x;
    for (double& x : image.cam_from_world.translation) fields >> x;
    fields >> image.camera_id >> image.name;
    if (!fields) throw std::runtime_error(path + ": ten fields are needed: " + line);
    std::getline(file, image.observations);
    images.push_back(image);
  }
  return images;
}

void WriteImages(const std::vector<Image>& images, const std::string& path) {
  std::ofstream file(path);
  file.precision(17);
  file << "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n# POINTS2D[] as (X, Y, POINT3D_ID)\n";
  for (const Image& image : images) {
    file << image.id;
    for (const double x : image.cam_from_world.quaternion_wxyz) file << ' ' << x;
    for (const double x : image.cam_from_world.translation) file << ' ' << x;
    file << ' ' << image.camera_id << ' ' << image.name << '\n' << image.observations << '\n';
  }
  file.close();
  if (!file) throw std::runtime_error(path + ": cannot be written");
}

void Copy(const std::string& from, const std::string& to) {
  std::ofstream copy(to, std::ios::binary);
  // An empty file has no buffer to insert.
  std::ifstream file = Open(from);
  copy << std::string(std::istreambuf_iterator<char>(file), {});
  copy.close();
  if (!copy) throw std::runtime_error(to + ": cannot be written");
}

void Run(const std::string& model, const std::string& pictures, const std::string& masks,
         const std::string& prior, const std::string& out) {
  const auto cameras = ReadCameras(model + "/cameras.txt");
  std::vector<Image> images = ReadImages(model + "/images.txt");
  spba::Sequence sequence;
  for (const Image& image : images) {
    const auto picture = samples::ReadPpm(pictures + "/" + image.name);
    const auto mask = samples::ReadPgm(masks + "/" + image.name.substr(0, image.name.rfind('.')) + ".pgm");
    spba::Frame frame;
    frame.name = image.name;
    frame.image = spba::Raster::Rgb(picture.data.data(), picture.width, picture.height);
    frame.mask = spba::Raster::Grey(mask.data.data(), mask.width, mask.height);
    frame.camera = cameras.at(image.camera_id);
    frame.cam_from_world = image.cam_from_world;
    sequence.Add(frame);
  }
  const spba::Solution solution = spba::Solve(sequence, spba::Prior::Load(prior));
  const Sim3 object_from_world = solution.object_from_world().value();
  for (std::size_t i = 0; i < images.size(); ++i) {
    images[i].cam_from_world = CamFromWorld(solution.cam_from_object(i), object_from_world);
    std::printf("%s silhouette IoU %.3f\n", images[i].name.c_str(), solution.silhouette_iou(i));
  }
  WriteImages(images, out + "/images.txt");
  Copy(model + "/cameras.txt", out + "/cameras.txt");
  Copy(model + "/points3D.txt", out + "/points3D.txt");
  std::ofstream object(out + "/object.txt");
  object.precision(17);
  object << "# object_from_world: scale, qw qx qy qz, tx ty tz (x_object = scale R x_world + t)\n"
         << object_from_world.scale;
  for (const double x : object_from_world.quaternion_wxyz) object << ' ' << x;
  for (const double x : object_from_world.translation) object << ' ' << x;
  object << '\n';
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 6) {
    std::cerr << "usage: colmap_refine MODEL IMAGES MASKS PRIOR.safetensors OUT\n";
    return 2;
  }
  Run(argv[1], argv[2], argv[3], argv[4], argv[5]);
  return 0;
} catch (const std::exception& error) {
  std::cerr << "error: " << error.what() << "\n";
  return 1;
}
