// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "core/base/stamp.hpp"
#include "drivers/velodyne/model.hpp"

namespace locus::velodyne {

/// Tells the model of a stream of packets. The product id alone does not do: there are VLP-16 that report the
/// HDL-32E's.
///
/// What cannot lie is the time between two packets, which follows from the model's firing sequence: from the second
/// packet on, a spacing that is the claimed model's (or a few times that, after loss) confirms it, and one that is
/// exactly another's overrules it until a spacing says otherwise. The first packet has no spacing. It is taken for what
/// it claims to be, except that a claimed HDL-32E whose blocks look like two sweeps of the same 16 lasers is a VLP-16.
/// One owner.
class ModelRecognition {
 public:
  /// `spacing`: since the packet before, by the lidar's clock; nothing for the first packet.
  Model recognise(Model claimed, ReturnMode mode, std::optional<Duration> spacing,
                  std::span<const std::byte, kDataPacketBytes> packet);

 private:
  Model claimed_{};
  std::optional<Model> verdict_; ///< on claimed_
};

/// Tells the pace of a model that has two, by the stamps of its packets: the two differ by 6 us a packet, in dual
/// return mode by 2 us, and a stamp is off by up to 3 us. Spacings are added up until they differ by more than that
/// from what lies between both paces; a lost or overtaken packet begins the sum anew. Until then, and for models with
/// one pace, it is the first. One owner.
class PaceRecognition {
 public:
  /// `spacing` as ModelRecognition has it.
  Pace recognise(Model model, ReturnMode mode, std::optional<Duration> spacing);

 private:
  Duration beyond_middle_{}; ///< of the spacings added up
  Pace pace_ = Pace::first;
};

} // namespace locus::velodyne
