// How plausible the style is.
#ifndef SPBA_CORE_TERMS_STYLE_H_
#define SPBA_CORE_TERMS_STYLE_H_

#include <memory>

#include "core/term.h"

namespace spba {

struct StyleOptions {
  double weight = 1.0;  // of -log p(s) = |s|^2 / 2
};

std::unique_ptr<const Term> MakeStyleTerm(const StyleOptions& options);

}  // namespace spba

#endif  // SPBA_CORE_TERMS_STYLE_H_
