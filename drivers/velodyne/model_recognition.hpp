// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "core/base/stamp.hpp"
#include "drivers/velodyne/model.hpp"

namespace locus::velodyne {

/// Recognises the model of a stream of packets. The product ID alone is insufficient: some VLP-16 report that of the
/// HDL-32E.
///
/// The time between two packets is reliable, since it follows from the model's firing sequence: from the second packet
/// on, a spacing of the claimed model (or a small multiple, after loss) confirms it, and one that exactly matches
/// another model overrides it until a spacing contradicts that. The first packet has no spacing: its claim is accepted,
/// except that a claimed HDL-32E whose blocks look like two sweeps of the same 16 lasers is a VLP-16. Single owner, not
/// thread-safe.
class ModelRecognition {
 public:
  /// Returns the model. `spacing`: time since the previous packet, by the lidar's clock; empty for the first packet.
  Model recognise(Model claimed, ReturnMode mode, std::optional<Duration> spacing,
                  std::span<const std::byte, kDataPacketBytes> packet);

 private:
  Model claimed_{};
  std::optional<Model> verdict_; ///< result for claimed_
};

/// Recognises the pace of a model that has two, by the stamps of its packets: the paces differ by 6 us per packet, in
/// dual return mode by 2 us, and a stamp is off by up to 3 us. Deviations from the midpoint of both paces are summed
/// until the sum exceeds the noise; a lost or overtaken packet resets the sum. Until then, and for models with one
/// pace, the result is the first pace. Single owner, not thread-safe.
class PaceRecognition {
 public:
  /// Returns the pace. `spacing`: see ModelRecognition.
  Pace recognise(Model model, ReturnMode mode, std::optional<Duration> spacing);

 private:
  Duration beyond_middle_{}; ///< accumulated deviation from the midpoint of both paces
  Pace pace_ = Pace::first;
};

} // namespace locus::velodyne
