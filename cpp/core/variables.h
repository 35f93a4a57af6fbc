// The unknowns of Eq. 9 and where their derivatives stand.
#ifndef SPBA_CORE_VARIABLES_H_
#define SPBA_CORE_VARIABLES_H_

#include <vector>

#include "core/geometry.h"

namespace spba {

struct Variables {
  std::vector<Pose> camera_from_object;  // L
  std::vector<double> style;             // S
  double log_alpha = 0.0;                // of Eq. 6: a scale is positive
  double log_focal = 0.0;                // of the factor by which all focal lengths are multiplied
};

// Where a variable's derivatives stand in a gradient of size() entries: [omega_l; t_l] for each frame, a
// twist about the current pose (Twisted), then the style, log alpha and log focal.
struct Layout {
  int frames = 0, styles = 0;

  int pose(int frame) const { return 6 * frame; }
  int style() const { return 6 * frames; }
  int log_alpha() const { return 6 * frames + styles; }
  int log_focal() const { return 6 * frames + styles + 1; }
  int size() const { return 6 * frames + styles + 2; }
};

}  // namespace spba

#endif  // SPBA_CORE_VARIABLES_H_
