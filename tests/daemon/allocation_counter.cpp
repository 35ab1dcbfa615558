// SPDX-License-Identifier: Apache-2.0
#include "daemon/allocation_counter.hpp"

#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <new>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define LOCUS_SANITIZED
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define LOCUS_SANITIZED
#endif
#endif

#ifdef LOCUS_SANITIZED

namespace locus::daemon {

std::optional<std::uint64_t> allocations() { return std::nullopt; }

} // namespace locus::daemon

#else

namespace {

std::atomic<std::uint64_t> g_allocations{0};

void* counted(void* memory) {
  g_allocations.fetch_add(1, std::memory_order_relaxed);
  if (memory == nullptr)
    throw std::bad_alloc{};
  return memory;
}

} // namespace

// All other forms of new and delete call these by default.
void* operator new(std::size_t bytes) { return counted(std::malloc(bytes > 0 ? bytes : 1)); }
void* operator new(std::size_t bytes, std::align_val_t alignment) {
  const auto step = static_cast<std::size_t>(alignment);
  return counted(std::aligned_alloc(step, (bytes + step - 1) / step * step));
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }

namespace locus::daemon {

std::optional<std::uint64_t> allocations() { return g_allocations.load(std::memory_order_relaxed); }

} // namespace locus::daemon

#endif
