// What is known of the focal length beforehand.
#ifndef SPBA_CORE_TERMS_FOCAL_H_
#define SPBA_CORE_TERMS_FOCAL_H_

#include <memory>

#include "core/term.h"

namespace spba {

struct FocalOptions {
  double deviation = 0.1;  // standard deviation of log focal
};

std::unique_ptr<const Term> MakeFocalTerm(const FocalOptions& options);

}  // namespace spba

#endif  // SPBA_CORE_TERMS_FOCAL_H_
