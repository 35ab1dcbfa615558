// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include "daemon/cache_line.hpp"

namespace locus::daemon {

/// Mailbox between one producer and one consumer that keeps only the newest value. Wait-free, never allocates.
///
/// Three buffers: one being filled, one being read, one in the middle; publish() and take() swap theirs with the
/// middle.
///
/// Why it is correct: the indices back_, middle_ and front_ are a permutation of 0, 1, 2, and the only operation that
/// changes it exchanges one's own index with the middle one atomically. So no buffer ever belongs to both sides, and
/// each call is one exchange without a loop. Each exchange
/// - releases: what the producer wrote into the buffer, or the consumer read from it, is over before the other side can
///   get hold of it;
/// - acquires: the buffer that comes back is seen as the other side left it.
/// The look before the exchange in take() may be relaxed: only take() clears kFresh, so what it saw set stays set, and
/// the exchange that follows orders everything. Exchanges of one atomic have a single order, so the consumer never gets
/// an older value after a newer one.
template <class T> class LatestSlot {
 public:
  /// Producer: fill this, valid until publish(). Holds what an earlier value left there, for reuse of its memory.
  [[nodiscard]] T& back() noexcept { return buffers_[back_]; }

  /// Producer: hands over back(); true if the value before was never taken, that is, dropped.
  [[nodiscard]] bool publish() noexcept {
    const std::uint8_t before = middle_.exchange(static_cast<std::uint8_t>(back_ | kFresh), std::memory_order_acq_rel);
    back_ = before & kIndex;
    return (before & kFresh) != 0;
  }

  /// Consumer: the newest value, or nullptr when there is none since the last call; valid until the next call.
  [[nodiscard]] T* take() noexcept {
    if ((middle_.load(std::memory_order_relaxed) & kFresh) == 0)
      return nullptr;
    front_ = middle_.exchange(front_, std::memory_order_acq_rel) & kIndex;
    return &buffers_[front_];
  }

 private:
  static constexpr std::uint8_t kIndex = 3;
  static constexpr std::uint8_t kFresh = 4; ///< the middle was published and not taken
  static_assert(std::atomic<std::uint8_t>::is_always_lock_free);

  alignas(kCacheLineBytes) std::uint8_t back_ = 0; ///< producer's own
  alignas(kCacheLineBytes) std::atomic<std::uint8_t> middle_{1};
  alignas(kCacheLineBytes) std::uint8_t front_ = 2; ///< consumer's own
  alignas(kCacheLineBytes) std::array<T, 3> buffers_{};
};

} // namespace locus::daemon
