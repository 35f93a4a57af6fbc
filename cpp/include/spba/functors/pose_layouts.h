// How a host keeps a pose b_from_a (x_b = R x_a + t) in parameter blocks. Each layout has
//   kBlocks, kSizes   its blocks and their sizes,
//   Apply             x_b of x_a, for autodiff,
//   AddTo             adds the blocks to a problem, with the manifold that keeps quaternions of unit length.
// Quaternions need not be of unit length to be evaluated: their length does not count. Without a manifold,
// Ceres moves along it in vain.
#ifndef SPBA_FUNCTORS_POSE_LAYOUTS_H_
#define SPBA_FUNCTORS_POSE_LAYOUTS_H_

#include <ceres/manifold.h>
#include <ceres/problem.h>
#include <ceres/product_manifold.h>
#include <ceres/rotation.h>
#include <ceres/version.h>

#include <array>

#if CERES_VERSION_MAJOR != 2 || CERES_VERSION_MINOR < 1 || CERES_VERSION_MINOR > 2
#error "spba/functors need Ceres 2.1 or 2.2"
#endif

namespace spba {
inline namespace v0 {
namespace functors {

// One block [omega; t], omega the rotation vector in radians.
struct AngleAxisTranslation {
  static constexpr int kBlocks = 1;
  static constexpr std::array<int, 1> kSizes{6};

  template <typename T>
  static void Apply(const T* const* blocks, const T* in_a, T* in_b) {
    ceres::AngleAxisRotatePoint(blocks[0], in_a, in_b);
    for (int i = 0; i < 3; ++i) in_b[i] += blocks[0][3 + i];
  }
  static void AddTo(ceres::Problem* problem, double* const* blocks) {
    problem->AddParameterBlock(blocks[0], 6);
  }
};

// Two blocks: the quaternion, its real part first, and t. COLMAP up to 3.8, and Ceres's own order.
struct QuaternionWxyzTranslation {
  static constexpr int kBlocks = 2;
  static constexpr std::array<int, 2> kSizes{4, 3};

  template <typename T>
  static void Apply(const T* const* blocks, const T* in_a, T* in_b) {
    ceres::QuaternionRotatePoint(blocks[0], in_a, in_b);
    for (int i = 0; i < 3; ++i) in_b[i] += blocks[1][i];
  }
  static void AddTo(ceres::Problem* problem, double* const* blocks) {
    problem->AddParameterBlock(blocks[0], 4, new ceres::QuaternionManifold);
    problem->AddParameterBlock(blocks[1], 3);
  }
};

// Two blocks: the quaternion, its real part last as Eigen stores it, and t. COLMAP 3.9 to 3.13.
struct QuaternionXyzwTranslation {
  static constexpr int kBlocks = 2;
  static constexpr std::array<int, 2> kSizes{4, 3};

  template <typename T>
  static void Apply(const T* const* blocks, const T* in_a, T* in_b) {
    const T* const q = blocks[0];
    const T wxyz[4] = {q[3], q[0], q[1], q[2]};
    const T* const reordered[2] = {wxyz, blocks[1]};
    QuaternionWxyzTranslation::Apply(reordered, in_a, in_b);
  }
  static void AddTo(ceres::Problem* problem, double* const* blocks) {
    problem->AddParameterBlock(blocks[0], 4, new ceres::EigenQuaternionManifold);
    problem->AddParameterBlock(blocks[1], 3);
  }
};

// One block of both. COLMAP from 4.0 on.
struct QuaternionXyzwTranslationInOne {
  static constexpr int kBlocks = 1;
  static constexpr std::array<int, 1> kSizes{7};

  template <typename T>
  static void Apply(const T* const* blocks, const T* in_a, T* in_b) {
    const T* const both[2] = {blocks[0], blocks[0] + 4};
    QuaternionXyzwTranslation::Apply(both, in_a, in_b);
  }
  static void AddTo(ceres::Problem* problem, double* const* blocks) {
    problem->AddParameterBlock(
        blocks[0], 7,
        new ceres::ProductManifold<ceres::EigenQuaternionManifold, ceres::EuclideanManifold<3>>);
  }
};

// The doubles of a pose's blocks together.
template <typename Layout>
constexpr int PoseSize() {
  int sum = 0;
  for (int i = 0; i < Layout::kBlocks; ++i) sum += Layout::kSizes[static_cast<std::size_t>(i)];
  return sum;
}

}  // namespace functors
}  // namespace v0
}  // namespace spba

#endif  // SPBA_FUNCTORS_POSE_LAYOUTS_H_
