// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "daemon/cache_line.hpp"

namespace locus::daemon {

/// Queue of at most N values between one producer and one consumer. Wait-free, never allocates.
///
/// Why it is correct: pushed_ and popped_ only grow, pushed_ is written by the producer alone and popped_ by the
/// consumer alone, and popped_ <= pushed_ <= popped_ + N always holds, because each side may see the other's count too
/// low but never too high. The places [popped_, pushed_) belong to the consumer and all others to the producer. A side
/// gives a place away with a release store of its count, after it is done with it, and the other takes it with an
/// acquire load of that count, before it touches it. Its own count a side may read relaxed. 64 bits do not wrap.
template <class T, std::size_t N> class SpscRing {
  static_assert(std::has_single_bit(N), "a power of two, so that a place is a mask away");

 public:
  /// Producer: false when the ring is full; the value is lost then, and it is for the caller to count it.
  [[nodiscard]] bool push(const T& value) noexcept {
    const std::uint64_t pushed = pushed_.load(std::memory_order_relaxed);
    if (pushed - popped_.load(std::memory_order_acquire) == N)
      return false;
    places_[pushed % N] = value;
    pushed_.store(pushed + 1, std::memory_order_release);
    return true;
  }

  /// Consumer: the oldest value, or nothing.
  [[nodiscard]] std::optional<T> pop() noexcept {
    const std::uint64_t popped = popped_.load(std::memory_order_relaxed);
    if (pushed_.load(std::memory_order_acquire) == popped)
      return std::nullopt;
    std::optional<T> value{places_[popped % N]};
    popped_.store(popped + 1, std::memory_order_release);
    return value;
  }

  /// Consumer: whether pop() would give nothing now.
  [[nodiscard]] bool empty() const noexcept {
    return pushed_.load(std::memory_order_acquire) == popped_.load(std::memory_order_relaxed);
  }

 private:
  static_assert(std::atomic<std::uint64_t>::is_always_lock_free);

  alignas(kCacheLineBytes) std::atomic<std::uint64_t> pushed_{0};
  alignas(kCacheLineBytes) std::atomic<std::uint64_t> popped_{0};
  alignas(kCacheLineBytes) std::array<T, N> places_{};
};

} // namespace locus::daemon
