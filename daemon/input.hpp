// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <variant>

#include "core/motion_sample.hpp"
#include "drivers/datagram.hpp"

namespace locus::daemon {

/// A sample of the motion source with this index in the configuration, whose kind it must fit.
struct ImuInput {
  std::size_t source;
  ImuSample sample;
};
struct OdometryInput {
  std::size_t source;
  OdometrySample sample;
};

/// Somebody outside says whether this motion source is healthy (its health_topic).
struct OutsideVerdict {
  std::size_t source;
  bool healthy;
};

/// Nothing has come in until `now`, in stamps of arrival.
struct Silence {
  Stamp now;
};

/// Nothing will ever come again; what the end of a recording says.
struct EndOfInput {};

/// All that can reach the ingest.
using Input = std::variant<Silence, Datagram, ImuInput, OdometryInput, OutsideVerdict, EndOfInput>;

/// Where input comes from: sockets and DDS readers in the daemon, a recording in a replay. One owner.
class InputSource {
 public:
  virtual ~InputSource() = default;

  /// The next input in the order of arrival, valid until the next call; Silence if none came within `timeout`, with a
  /// time not later than the arrival of the next. Allocates nothing, throws nothing. After EndOfInput it is not called.
  virtual Input next(Duration timeout) = 0;
};

} // namespace locus::daemon
