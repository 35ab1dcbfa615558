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

/// Alignment of data shared between threads, to avoid false sharing. A fixed value, since
/// std::hardware_destructive_interference_size may differ between compilers.
inline constexpr std::size_t kCacheLineBytes = 64;

/// Queue of at most N values between one producer and one consumer. Wait-free, never allocates.
///
/// Correctness: pushed_ and popped_ only grow, pushed_ is written by the producer only and popped_ by the consumer
/// only, and popped_ <= pushed_ <= popped_ + N always holds, because each side may read the other's count too low but
/// never too high. Slots [popped_, pushed_) belong to the consumer, all others to the producer. A side releases a slot
/// by a release store of its count after its last access, and the other acquires it by an acquire load of that count
/// before its first access. Each side may read its own count relaxed. 64 bits do not wrap.
template <class T, std::size_t N> class SpscRing {
  static_assert(std::has_single_bit(N), "a power of two, so that an index is a mask away");

 public:
  /// Producer: appends a value; false if the ring is full. The value is then lost, and the caller counts it.
  [[nodiscard]] bool push(const T& value) noexcept {
    const std::uint64_t pushed = pushed_.load(std::memory_order_relaxed);
    if (pushed - popped_.load(std::memory_order_acquire) == N)
      return false;
    slots_[pushed % N] = value;
    pushed_.store(pushed + 1, std::memory_order_release);
    return true;
  }

  /// Producer: returns the least number of values that push() will accept.
  [[nodiscard]] std::size_t free_slots() const noexcept {
    return N -
           static_cast<std::size_t>(pushed_.load(std::memory_order_relaxed) - popped_.load(std::memory_order_acquire));
  }

  /// Consumer: removes and returns the oldest value; empty if there is none.
  [[nodiscard]] std::optional<T> pop() noexcept {
    const std::uint64_t popped = popped_.load(std::memory_order_relaxed);
    if (pushed_.load(std::memory_order_acquire) == popped)
      return std::nullopt;
    std::optional<T> value{slots_[popped % N]};
    popped_.store(popped + 1, std::memory_order_release);
    return value;
  }

  /// Consumer: true if pop() would return nothing.
  [[nodiscard]] bool empty() const noexcept {
    return pushed_.load(std::memory_order_acquire) == popped_.load(std::memory_order_relaxed);
  }

 private:
  static_assert(std::atomic<std::uint64_t>::is_always_lock_free);

  alignas(kCacheLineBytes) std::atomic<std::uint64_t> pushed_{0};
  alignas(kCacheLineBytes) std::atomic<std::uint64_t> popped_{0};
  alignas(kCacheLineBytes) std::array<T, N> slots_{};
};

/// Mailbox between one producer and one consumer that holds only the newest value. Wait-free, never allocates.
///
/// Triple buffer: one being filled, one being read, one in the middle; publish() and poll() swap theirs with the
/// middle.
///
/// Correctness: the indices back_, middle_ and front_ are a permutation of 0, 1, 2, changed only by an atomic exchange
/// of a side's own index with the middle one. So no buffer ever belongs to both sides, and each call is one exchange
/// without a loop. Each exchange
/// - releases: accesses by this side to the buffer it hands over happen before those of the other side;
/// - acquires: the buffer it receives is visible as the other side left it.
/// The load before the exchange in poll() may be relaxed: only poll() clears kFresh, so a set flag stays set, and the
/// exchange that follows provides the ordering. Exchanges of one atomic have a single total order, so the consumer
/// never receives an older value after a newer one.
template <class T> class LatestSlot {
 public:
  /// Producer: returns the buffer to fill, valid until publish(). It holds an earlier value, whose memory can be
  /// reused.
  [[nodiscard]] T& back() noexcept { return buffers_[back_]; }

  /// Producer: hands over back(); true if the previous value was never consumed, that is, dropped.
  [[nodiscard]] bool publish() noexcept {
    const std::uint8_t before = middle_.exchange(static_cast<std::uint8_t>(back_ | kFresh), std::memory_order_acq_rel);
    back_ = before & kIndex;
    return (before & kFresh) != 0;
  }

  /// Consumer: returns the newest value, or nullptr if there is none since the last call; valid until the next call.
  [[nodiscard]] T* poll() noexcept {
    if ((middle_.load(std::memory_order_relaxed) & kFresh) == 0)
      return nullptr;
    front_ = middle_.exchange(front_, std::memory_order_acq_rel) & kIndex;
    return &buffers_[front_];
  }

 private:
  static constexpr std::uint8_t kIndex = 3;
  static constexpr std::uint8_t kFresh = 4; ///< the middle value was published and not yet consumed
  static_assert(std::atomic<std::uint8_t>::is_always_lock_free);

  alignas(kCacheLineBytes) std::uint8_t back_ = 0; ///< owned by the producer
  alignas(kCacheLineBytes) std::atomic<std::uint8_t> middle_{1};
  alignas(kCacheLineBytes) std::uint8_t front_ = 2; ///< owned by the consumer
  alignas(kCacheLineBytes) std::array<T, 3> buffers_{};
};

/// Blocks a consumer until a separate lock-free queue has data, or until a timeout.
///
/// Uses the C library's semaphore: notify() is one atomic addition and, if a thread waits, one futex call.
/// std::counting_semaphore is unsuitable: its timed wait in libstdc++ polls with pauses of up to 64 ms. A notification
/// is a hint to check the queue again; one before the wait is not lost, and several coalesce. Any thread may notify,
/// one waits.
class Wakeup {
 public:
  Wakeup();
  ~Wakeup();
  Wakeup(const Wakeup&) = delete;
  Wakeup& operator=(const Wakeup&) = delete;

  void notify() noexcept;

  /// Returns after a notification not yet consumed by an earlier wait, or after `timeout`. Consumes all pending ones.
  void wait_for(Duration timeout) noexcept;

 private:
  sem_t semaphore_{};
};

/// Thread that services a separate queue, such as a LatestSlot or an SpscRing, when its producer notifies it.
///
/// Runs a round after each notification, at least every `period`, and a last one in the destructor, which joins the
/// thread. One owner; any thread may notify.
class Worker {
 public:
  /// Callback of a round; `last` is true for the last one.
  using Round = std::function<void(bool last)>;

  /// Starts the thread. `name` appears in top -H, 15 characters at most; `begin` runs once in the thread.
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
