#include "bridge/memory.h"

#include <stdlib.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace spba {
namespace bridge {

void keep_freed_memory() noexcept {
#ifdef __GLIBC__
  // Else buffers of a few hundred kilobytes, which every evaluation allocates, come from the kernel and go
  // back to it page by page.
  mallopt(M_MMAP_THRESHOLD, 32 << 20);  // the most that glibc takes
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
  mallopt(M_TOP_PAD, 16 << 20);
#endif
}

}  // namespace bridge
}  // namespace spba
