// What the allocator does with freed memory.
#pragma once

namespace spba {
namespace bridge {

// Keeps it for the process, where the C library is glibc.
void keep_freed_memory() noexcept;

}  // namespace bridge
}  // namespace spba
