// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "daemon/input.hpp"

namespace locus::daemon {

/// Gives the inputs of a recording out when they are due: as they once arrived, `speed` times as fast. One owner.
class PacedInput : public InputSource {
 public:
  /// A step in the stamps of arrival that is longer than this is no pause but another clock, and is not waited for.
  static constexpr Duration kMaxPause = std::chrono::seconds{10};

  /// `recording` must outlive this; where it is silent, that is for a time it knows. Precondition: speed > 0.
  PacedInput(InputSource& recording, double speed) : recording_(recording), speed_(speed) {}

  Input next(Duration timeout) override;

 private:
  struct Held { ///< read from the recording, not given out yet
    Input input;
    Stamp arrival;
  };

  void read_ahead();

  InputSource& recording_;
  double speed_;
  std::optional<Held> held_;
  bool started_ = false;
  Stamp last_arrival_;
  Stamp anchor_arrival_;    ///< this arrival ...
  Duration anchor_clock_{}; ///< ... is due when CLOCK_MONOTONIC shows this
};

} // namespace locus::daemon
