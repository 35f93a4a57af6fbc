#include "bridge/free_depth.h"

#include <ceres/ceres.h>

#include <cmath>
#include <memory>
#include <stdexcept>
#include <vector>

#include "bridge/baseline.h"
#include "bridge/logs.h"
#include "spba-ceres/src/bridge/bundle.rs.h"
#include "spba/photometric.h"

namespace spba {
namespace bridge {
namespace {

constexpr int kResiduals = 3 * FreeDepthCost::kPatch;

using Samplers = std::vector<std::unique_ptr<ImageSampler>>;

std::unique_ptr<ceres::CostFunction> Cost(const FreePixel& pixel, std::uint32_t source,
                                          const Samplers& samplers, const Pinhole& camera) {
  return std::unique_ptr<ceres::CostFunction>(FreeDepthCost::Create(
      {camera, camera, samplers[pixel.frame].get(), samplers[source].get()}, pixel.x, pixel.y));
}

// What the residuals of a pixel say of its inverse depth; the cameras count as known.
void Judge(FreePixel& pixel, rust::Slice<double> cameras, const Samplers& samplers, const Pinhole& camera) {
  double squares = 0.0, information = 0.0;
  int count = 0;
  for (const std::uint32_t source : pixel.seen_in) {
    const auto cost = Cost(pixel, source, samplers, camera);
    const double* parameters[] = {&cameras[6 * pixel.frame], &cameras[6 * source], &pixel.inverse_depth};
    double residuals[kResiduals], by_depth[kResiduals];
    double* jacobians[] = {nullptr, nullptr, by_depth};
    if (!cost->Evaluate(parameters, residuals, jacobians)) continue;
    count += kResiduals;
    for (int i = 0; i < kResiduals; ++i) {
      squares += residuals[i] * residuals[i];
      information += by_depth[i] * by_depth[i];
    }
  }
  pixel.error = count == 0 ? HUGE_VAL : std::sqrt(squares / count);
  pixel.deviation = information > 0.0 ? 1.0 / std::sqrt(information) : HUGE_VAL;
}

}  // namespace

void adjust_photometric(rust::Slice<double> cameras, rust::Vec<FreePixel>& pixels,
                        rust::Slice<const float> images, const PhotometricOptions& options) {
  RouteLogs();
  const std::size_t frames = cameras.size() / 6;
  const std::size_t size = std::size_t{3} * options.width * options.height;
  if (size == 0 || cameras.size() % 6 != 0 || images.size() != frames * size) {
    throw std::invalid_argument("six numbers and one image a camera are needed");
  }
  Samplers samplers;
  for (std::size_t frame = 0; frame < frames; ++frame) {
    samplers.push_back(std::make_unique<ImageSampler>(
        images.data() + frame * size, static_cast<int>(options.width), static_cast<int>(options.height)));
  }
  const Pinhole camera{options.fx, options.fy, options.cx, options.cy};
  ceres::Problem problem;
  const auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (FreePixel& pixel : pixels) {
    for (const std::uint32_t source : pixel.seen_in) {
      if (pixel.frame >= frames || source >= frames || source == pixel.frame) {
        throw std::invalid_argument("no such camera");
      }
      problem.AddResidualBlock(Cost(pixel, source, samplers, camera).release(),
                               new ceres::HuberLoss(options.loss_width * std::sqrt(double{kResiduals})),
                               &cameras[6 * pixel.frame], &cameras[6 * source], &pixel.inverse_depth);
      ordering->AddElementToGroup(&pixel.inverse_depth, 0);
    }
  }
  if (problem.NumResidualBlocks() == 0) return;
  for (std::size_t frame = 0; frame < frames; ++frame) {
    double* const block = &cameras[6 * frame];
    if (!problem.HasParameterBlock(block)) continue;
    ordering->AddElementToGroup(block, 1);
    if (options.hold_cameras) problem.SetParameterBlockConstant(block);
  }
  if (!options.hold_cameras) HoldGauge(problem, cameras.data(), frames);
  ceres::Solver::Options solver;
  solver.linear_solver_type = options.hold_cameras ? ceres::SPARSE_NORMAL_CHOLESKY : ceres::DENSE_SCHUR;
  if (!options.hold_cameras) solver.linear_solver_ordering = ordering;
  solver.max_num_iterations = static_cast<int>(options.max_iterations);
  solver.num_threads = 1;
  solver.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  if (!summary.IsSolutionUsable()) throw std::runtime_error(summary.message);
  for (FreePixel& pixel : pixels) Judge(pixel, cameras, samplers, camera);
}

}  // namespace bridge
}  // namespace spba
