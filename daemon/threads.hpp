// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <thread>

#include <semaphore.h>

#include "core/base/stamp.hpp"

namespace locus::daemon {

/// What one thread writes and another reads is kept this far from everything else, or each write would take the
/// neighbours from the other's cache. The standard's constant for it may differ from compiler to compiler.
inline constexpr std::size_t kCacheLineBytes = 64;

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

  /// Producer: how many values push() will take at least.
  [[nodiscard]] std::size_t free_places() const noexcept {
    return N -
           static_cast<std::size_t>(pushed_.load(std::memory_order_relaxed) - popped_.load(std::memory_order_acquire));
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

/// Lets a consumer sleep until a lock-free queue beside it has something, and not a moment longer than a timeout.
///
/// The semaphore of the C library: notify() is one atomic addition and, if somebody sleeps, one futex call. That of the
/// standard library will not do: its timed wait in libstdc++ polls with pauses that grow to 64 ms. A notification is a
/// hint to look again; one that comes before the wait is not lost, and many together are one. Any thread may notify,
/// one waits.
class Wakeup {
 public:
  Wakeup();
  ~Wakeup();
  Wakeup(const Wakeup&) = delete;
  Wakeup& operator=(const Wakeup&) = delete;

  void notify() noexcept;

  /// Returns after a notification that no earlier wait has used, or after `timeout`. Uses all that have come.
  void wait_for(Duration timeout) noexcept;

 private:
  sem_t semaphore_{};
};

/// A thread that looks into a queue beside it, such as a LatestSlot or an SpscRing, whenever its producer notifies it.
///
/// It does a round after each notification, every `period` at the latest, and a last one when it is destroyed, which
/// waits for it. One owner; any thread may notify.
class Worker {
 public:
  /// Is told whether it is the last round.
  using Round = std::function<void(bool last)>;

  /// `name` is what top -H shows, 15 characters at most; `begin` is done once, in the thread.
  Worker(const char* name, Duration period, Round round, std::function<void()> begin = {});
  ~Worker();
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  void notify() noexcept { wakeup_.notify(); }

 private:
  Wakeup wakeup_;
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

} // namespace locus::daemon
