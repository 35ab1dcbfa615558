// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/sources/motion_sample.hpp"
#include "drivers/lidar_router.hpp"
#include "drivers/net/datagram.hpp"
#include "faults/fault.hpp"

namespace locus {

/// Applies the faults of one motion source to its samples as they stream. An emitted sample carries its arrival after
/// the faults, which may be later than that of the next one emitted. One owner.
template <class Sample> class SampleFaults {
 public:
  using Emit = std::function<void(const Sample&)>;

  /// Precondition: fault_problem() returns nothing.
  SampleFaults(std::span<const Fault> faults, std::string source, Stamp capture_start, std::uint64_t seed)
      : plan_(faults, capture_start, seed), source_(std::move(source)) {}

  /// Emits the result for this sample and for one that it overtakes. Precondition: samples come in order of arrival.
  void pass(Sample sample, const Emit& emit);

  /// Emits what is still held back, at the end of the recording.
  void finish(const Emit& emit);

 private:
  FaultPlan plan_;
  std::string source_;
  std::optional<Sample> healthy_;   ///< latest sample that was not frozen
  std::optional<Sample> overtaken_; ///< waits to be overtaken by the next one
};

/// Applies faults to all samples of a recording; the result is sorted by arrival.
template <class Sample>
void inject_faults(std::span<const Fault> faults, const std::string& source, Stamp capture_start, std::uint64_t seed,
                   std::vector<Sample>& samples);

/// Applies the faults of lidars to the datagrams of a capture as they stream. The receive stamp of a datagram that is
/// late or overtaken changes accordingly; datagrams held back are emitted in order of arrival. The position packets of
/// a lidar form a stream of their own: its faults affect them too, but a packet repeats or overtakes only its like. The
/// same holds for an Ouster's packets with readings of its inertial unit, the motion source NAME_imu; a lidar's jump
/// offsets its ranges, and its clock step its columns. Checksums of packets are updated after a jump or a clock step.
/// One owner.
class DatagramFaults {
 public:
  /// Receives a datagram, valid only during the call.
  using Emit = std::function<void(const Datagram&)>;

  /// Precondition: fault_problem() returns nothing.
  DatagramFaults(std::span<const Fault> faults, Stamp capture_start, std::uint64_t seed)
      : plan_(faults, capture_start, seed) {}

  /// Emits the datagrams due by the time of this one, then the result for it.
  void pass(const LidarRouter::Origin& origin, const Datagram& datagram, const Emit& emit);

  /// Emits what is still held back, at the end of the capture.
  void finish(const Emit& emit);

 private:
  /// Datagram that owns its payload; its receive stamp is that after all faults.
  struct Copy {
    Datagram datagram; ///< without payload
    std::vector<std::byte> payload;

    void emit_to(const Emit& emit) const;
  };
  struct Stream {
    std::vector<std::byte> healthy; ///< latest payload that was not frozen
    std::optional<Copy> overtaken;  ///< waits to be overtaken by the next one
  };

  void deliver(Copy copy, Stamp now, const Emit& emit);
  void emit_delayed(Stamp now, const Emit& emit);

  FaultPlan plan_;
  std::map<std::string, Stream, std::less<>> streams_;
  std::multimap<Stamp, Copy> delayed_; ///< by arrival; at most the traffic of the longest delay
};

} // namespace locus
