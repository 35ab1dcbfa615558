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
#include "drivers/lidar_input.hpp"
#include "drivers/net/datagram.hpp"
#include "faults/fault.hpp"

namespace locus {

/// Applies the faults meant for one motion source to its samples as they come. What is given out has the arrival that
/// the faults leave it, and so may arrive after what is given out next. One owner.
template <class Sample> class SampleFaults {
 public:
  using Emit = std::function<void(const Sample&)>;

  /// Precondition: fault_problem() finds nothing.
  SampleFaults(std::span<const Fault> faults, std::string source, Stamp capture_start, std::uint64_t seed)
      : plan_(faults, capture_start, seed), source_(std::move(source)) {}

  /// Emits what becomes of this sample, and what it overtakes. Precondition: it arrives after those before.
  void pass(Sample sample, const Emit& emit);

  /// Emits what is still held back. The recording is over.
  void finish(const Emit& emit);

 private:
  FaultPlan plan_;
  std::string source_;
  std::optional<Sample> healthy_;   ///< the latest that was not frozen
  std::optional<Sample> overtaken_; ///< waits for the next one to pass it
};

/// The same for all samples of a recording, which stay in the order of their arrival.
template <class Sample>
void inject_faults(std::span<const Fault> faults, const std::string& source, Stamp capture_start, std::uint64_t seed,
                   std::vector<Sample>& samples);

/// Applies the faults meant for lidars to the datagrams of a capture as they stream by. The receive stamp of a datagram
/// that is late or overtaken moves along; what is held back comes out in the order of arrival. The position packets of
/// a lidar are a stream of their own: its faults strike them too, but one packet repeats or overtakes its like only. So
/// are an Ouster's packets with the readings of its inertial unit, the motion source NAME_imu; a lidar's jump is one of
/// its ranges, and its clock step one of its columns. Where a packet has a checksum, it is right for what a jump or a
/// clock step has made of it. One owner.
class DatagramFaults {
 public:
  /// Takes a datagram, valid only during the call.
  using Emit = std::function<void(const Datagram&)>;

  /// Precondition: fault_problem() finds nothing.
  DatagramFaults(std::span<const Fault> faults, Stamp capture_start, std::uint64_t seed)
      : plan_(faults, capture_start, seed) {}

  /// Emits what is due by the time of this datagram, then what becomes of it.
  void pass(const LidarRouter::Origin& origin, const Datagram& datagram, const Emit& emit);

  /// Emits what is still held back. The capture is over.
  void finish(const Emit& emit);

 private:
  /// A datagram that owns its payload; its receive stamp is that of its arrival after all faults.
  struct Copy {
    Datagram datagram; ///< without payload
    std::vector<std::byte> payload;

    void emit_to(const Emit& emit) const;
  };
  struct Stream {
    std::vector<std::byte> healthy; ///< the latest payload that was not frozen
    std::optional<Copy> overtaken;  ///< waits for the next one to pass it
  };

  void deliver(Copy copy, Stamp now, const Emit& emit);
  void emit_delayed(Stamp now, const Emit& emit);

  FaultPlan plan_;
  std::map<std::string, Stream, std::less<>> streams_;
  std::multimap<Stamp, Copy> delayed_; ///< by time of arrival; at most the traffic of the longest delay
};

} // namespace locus
