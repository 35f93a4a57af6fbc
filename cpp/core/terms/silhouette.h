// The silhouettes' Chamfer distance (Eq. 5).
#ifndef SPBA_CORE_TERMS_SILHOUETTE_H_
#define SPBA_CORE_TERMS_SILHOUETTE_H_

#include <memory>
#include <vector>

#include "core/term.h"

namespace spba {

// What a frame gives to the term.
struct SilhouetteShare {
  std::vector<Vector2> pixels;  // centres of those of U_l1 in use
  double pixel_weight = 1.0;    // what each counts
  int points = 0;               // how many of the points are in use for the other direction
  double point_weight = 1.0;    // what each counts
};

struct SilhouetteOptions {
  double weight = 0.1;        // lambda_1
  double cauchy_width = 0.0;  // pixels; 0 = none
  double tolerance = 0.0;     // pixels
  std::vector<SilhouetteShare> frames;
};

std::unique_ptr<const Term> MakeSilhouetteTerm(SilhouetteOptions options);

}  // namespace spba

#endif  // SPBA_CORE_TERMS_SILHOUETTE_H_
