// Trust in the off-the-shelf motion: Eq. 13 as a term.
#ifndef SPBA_CORE_TERMS_MOTION_H_
#define SPBA_CORE_TERMS_MOTION_H_

#include <memory>
#include <vector>

#include "core/term.h"
#include "spba/motion.h"

namespace spba {

// Between two frames.
struct KnownMotion {
  int a, b;
  MotionError error;
};

struct MotionOptions {
  double weight = 0.0;        // of a mean over frames
  double cauchy_width = 1.0;  // object diagonals
  int frames = 0;             // L
  std::vector<KnownMotion> motions;
};

std::unique_ptr<const Term> MakeMotionTerm(MotionOptions options);

}  // namespace spba

#endif  // SPBA_CORE_TERMS_MOTION_H_
