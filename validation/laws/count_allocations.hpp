#pragma once

#include <atomic>
#include <cerrno>
#include <cstddef>
#include <functional>

/// Counts every heap allocation of the program, those of libraries, plugins and operator new included, by
/// taking the place of glibc's malloc.  To be included in one source of a program.  With another C library,
/// and under a sanitizer, which needs malloc for itself, nothing is counted.
#if !defined(__GLIBC__) || defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define DIRACSTEP_COUNTS_ALLOCATIONS 0
#elif defined(__has_feature)  // Clang tells of sanitizers so
#define DIRACSTEP_COUNTS_ALLOCATIONS \
  !(__has_feature(address_sanitizer) || __has_feature(thread_sanitizer) || __has_feature(memory_sanitizer))
#else
#define DIRACSTEP_COUNTS_ALLOCATIONS 1
#endif

namespace diracstep {

inline constexpr bool counts_allocations = DIRACSTEP_COUNTS_ALLOCATIONS;
inline std::atomic<long> allocations{0};

/// For CheckOptions::allocations; empty where nothing is counted.
inline std::function<long()> allocation_counter() {
  if (!counts_allocations) return {};
  return [] { return allocations.load(); };
}

}  // namespace diracstep

#if DIRACSTEP_COUNTS_ALLOCATIONS

extern "C" {

void* __libc_malloc(std::size_t size);                           // NOLINT
void* __libc_calloc(std::size_t count, std::size_t size);        // NOLINT
void* __libc_realloc(void* block, std::size_t size);             // NOLINT
void* __libc_memalign(std::size_t alignment, std::size_t size);  // NOLINT

void* malloc(std::size_t size) {
  ++diracstep::allocations;
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) {
  ++diracstep::allocations;
  return __libc_calloc(count, size);
}
void* realloc(void* block, std::size_t size) {
  ++diracstep::allocations;
  return __libc_realloc(block, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  ++diracstep::allocations;
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** block, std::size_t alignment, std::size_t size) {
  *block = aligned_alloc(alignment, size);
  return *block != nullptr ? 0 : ENOMEM;
}
}

#endif
