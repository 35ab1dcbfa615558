// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/motion_sample.hpp"
#include "drivers/datagram.hpp"
#include "drivers/fault.hpp"

namespace locus {

/// Applies the faults meant for `source` to its recorded samples, which stay in the order of their arrival.
/// Precondition: they are in it, and fault_problem() finds nothing.
void inject_faults(std::span<const Fault> faults, std::string_view source, Stamp capture_start, std::uint64_t seed,
                   std::vector<ImuSample>& samples);
void inject_faults(std::span<const Fault> faults, std::string_view source, Stamp capture_start, std::uint64_t seed,
                   std::vector<OdometrySample>& samples);

/// Applies the faults meant for lidars to the datagrams of a capture as they stream by. The receive stamp of a datagram
/// that is late or overtaken moves along; what is held back comes out in the order of arrival. Frozen are data packets
/// only: position packets go on. One owner.
class DatagramFaults {
 public:
  /// Takes a datagram, valid only during the call.
  using Emit = std::function<void(const Datagram&)>;

  /// Precondition: fault_problem() finds nothing.
  DatagramFaults(std::span<const Fault> faults, Stamp capture_start, std::uint64_t seed)
      : plan_(faults, capture_start, seed) {}

  /// Emits what is due by the time of this datagram, then what becomes of it. `lidar` is the name of the lidar that it
  /// comes from, empty for none.
  void pass(std::string_view lidar, const Datagram& datagram, const Emit& emit);

  /// Emits what is still held back. The capture is over.
  void finish(const Emit& emit);

 private:
  /// A datagram that owns its payload; its receive stamp is that of its arrival after all faults.
  struct Copy {
    Datagram datagram; ///< without payload
    std::vector<std::byte> payload;

    void emit_to(const Emit& emit) const;
  };
  struct LidarState {
    std::vector<std::byte> last_data_packet; ///< before the lidar froze
    std::optional<Copy> overtaken;           ///< waits for the next one to pass it
  };

  void deliver(Copy copy, Stamp now, const Emit& emit);
  void emit_delayed(Stamp now, const Emit& emit);

  FaultPlan plan_;
  std::map<std::string, LidarState, std::less<>> lidars_;
  std::multimap<Stamp, Copy> delayed_; ///< by time of arrival; at most the traffic of the longest delay
};

} // namespace locus
