// Work in parts that do not depend on the number of threads.
#ifndef SPBA_CORE_PARALLEL_H_
#define SPBA_CORE_PARALLEL_H_

#include <functional>

namespace spba {

// Calls work(i) for i = 0 .. count - 1 on up to `threads` threads, in any order. Rethrows the exception of
// the lowest i that threw.
void ParallelFor(int count, int threads, const std::function<void(int)>& work);

}  // namespace spba

#endif  // SPBA_CORE_PARALLEL_H_
