#include "core/coordinates.h"

#include <algorithm>

namespace spba {

Coordinates::Coordinates(const Variables& start, const Free& free, int target)
    : start_(start),
      free_(free),
      target_(target),
      layout_{static_cast<int>(start.camera_from_object.size()), static_cast<int>(start.style.size())} {
  style_ = free.poses == PoseMotion::kTogether ? 6 : 6 * start.camera_from_object.size();
  values_.assign(style_, 0.0);
  values_.insert(values_.end(), start.style.begin(), start.style.end());
  values_.push_back(start.log_alpha);
  values_.push_back(start.log_focal);
  const auto add = [this](const double* values, int size) {
    blocks_.push_back({static_cast<size_t>(values - values_.data()), size});
    free_count_ += size;
  };
  switch (free.poses) {
    case PoseMotion::kHeld:
      break;
    case PoseMotion::kTogether:
      add(&values_[0], 6);
      break;
    case PoseMotion::kEach:
    case PoseMotion::kSources:
      for (int l = 0; l < layout_.frames; ++l) {
        if (free.poses == PoseMotion::kEach || l != target) add(PoseBlock(l), 6);
      }
      break;
  }
  if (free.style) add(StyleBlock(), layout_.styles);
  if (free.log_alpha) add(LogAlphaBlock(), 1);
  if (free.log_focal) add(LogFocalBlock(), 1);
}

bool Coordinates::IsFree(const double* block) const {
  return std::any_of(blocks_.begin(), blocks_.end(),
                     [&](const Block& b) { return &values_[b.offset] == block; });
}

void Coordinates::SetBlocks(double const* const* parameters) {
  for (size_t i = 0; i < blocks_.size(); ++i) {
    std::copy_n(parameters[i], blocks_[i].size, &values_[blocks_[i].offset]);
  }
}

Variables Coordinates::Current() const {
  Variables variables;
  variables.camera_from_object.reserve(start_.camera_from_object.size());
  const bool together = free_.poses == PoseMotion::kTogether;
  for (int l = 0; l < layout_.frames; ++l) {
    const Pose& pose = start_.camera_from_object[static_cast<size_t>(l)];
    if (together) {
      const Vector3 omega(values_[0], values_[1], values_[2]);
      const Matrix3& target = start_.camera_from_object[static_cast<size_t>(target_)].rotation;
      const Vector3 turn = pose.rotation * (target.transpose() * omega);
      const double twist[6] = {turn[0], turn[1], turn[2], values_[3], values_[4], values_[5]};
      variables.camera_from_object.push_back(Twisted(pose, twist));
    } else {
      variables.camera_from_object.push_back(Twisted(pose, &values_[6 * static_cast<size_t>(l)]));
    }
  }
  const auto style = values_.begin() + static_cast<std::ptrdiff_t>(style_);
  variables.style.assign(style, style + layout_.styles);
  variables.log_alpha = style[layout_.styles];
  variables.log_focal = style[layout_.styles + 1];
  return variables;
}

Matrix3 Coordinates::ByOmega(int l) const {
  if (free_.poses != PoseMotion::kTogether) {
    const double* const omega = &values_[6 * static_cast<size_t>(l)];
    return LeftJacobian(Vector3(omega[0], omega[1], omega[2]));
  }
  const Matrix3 frame_from_target =
      start_.camera_from_object[static_cast<size_t>(l)].rotation *
      start_.camera_from_object[static_cast<size_t>(target_)].rotation.transpose();
  return frame_from_target * LeftJacobian(Vector3(values_[0], values_[1], values_[2]));
}

RowMajorMatrix Coordinates::Reduced(const RowMajorMatrix& rows) const {
  RowMajorMatrix reduced(free_count_, rows.cols());
  int at = 0;
  const auto add_pose = [&](int l, int to) {
    reduced.middleRows(to, 3).noalias() += ByOmega(l).transpose() * rows.middleRows(layout_.pose(l), 3);
    reduced.middleRows(to + 3, 3) += rows.middleRows(layout_.pose(l) + 3, 3);
  };
  if (free_.poses == PoseMotion::kTogether) {
    reduced.topRows(6).setZero();
    for (int l = 0; l < layout_.frames; ++l) add_pose(l, 0);
    at = 6;
  } else if (free_.poses != PoseMotion::kHeld) {
    for (int l = 0; l < layout_.frames; ++l) {
      if (free_.poses == PoseMotion::kSources && l == target_) continue;
      reduced.middleRows(at, 6).setZero();
      add_pose(l, at);
      at += 6;
    }
  }
  const auto copy = [&](int from, int size) {
    reduced.middleRows(at, size) = rows.middleRows(from, size);
    at += size;
  };
  if (free_.style) copy(layout_.style(), layout_.styles);
  if (free_.log_alpha) copy(layout_.log_alpha(), 1);
  if (free_.log_focal) copy(layout_.log_focal(), 1);
  return reduced;
}

Eigen::VectorXd Coordinates::Gradient(const Eigen::VectorXd& of_layout) const { return Reduced(of_layout); }

RowMajorMatrix Coordinates::NormalMatrix(const RowMajorMatrix& of_layout) const {
  return Reduced(Reduced(of_layout).transpose());
}

}  // namespace spba
