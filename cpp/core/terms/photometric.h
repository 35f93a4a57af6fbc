// Photometric consistency (Eq. 4).
#ifndef SPBA_CORE_TERMS_PHOTOMETRIC_H_
#define SPBA_CORE_TERMS_PHOTOMETRIC_H_

#include <memory>

#include "core/term.h"

namespace spba {

struct PhotometricOptions {
  double weight = 1.0;        // times a pair's own
  double huber_width = 20.0;  // delta_1, in the images' range
};

std::unique_ptr<const Term> MakePhotometricTerm(const PhotometricOptions& options);

}  // namespace spba

#endif  // SPBA_CORE_TERMS_PHOTOMETRIC_H_
