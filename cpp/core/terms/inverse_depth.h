// Agreement with off-the-shelf inverse depth (Eq. 6).
#ifndef SPBA_CORE_TERMS_INVERSE_DEPTH_H_
#define SPBA_CORE_TERMS_INVERSE_DEPTH_H_

#include <memory>

#include "core/term.h"

namespace spba {

struct InverseDepthOptions {
  double weight = 1000.0;     // lambda_2
  double huber_width = 10.0;  // delta_2, in the off-the-shelf reconstruction's inverse units
  int frames = 0;             // L, over which Eq. 6 is a mean
};

std::unique_ptr<const Term> MakeInverseDepthTerm(const InverseDepthOptions& options);

}  // namespace spba

#endif  // SPBA_CORE_TERMS_INVERSE_DEPTH_H_
