// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <variant>

#include "core/base/source_id.hpp"
#include "core/sources/motion_sample.hpp"
#include "drivers/net/datagram.hpp"

namespace locus {
class LidarRouter;
}

namespace locus::daemon {

/// A sample of a motion source, whose kind it must fit.
struct ImuInput {
  SourceId source;
  ImuSample sample;
};
struct OdometryInput {
  SourceId source;
  OdometrySample sample;
};

/// Somebody outside says whether this motion source is healthy (its health_topic).
struct OutsideVerdict {
  SourceId source;
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

/// When it arrived; `otherwise` for what does not tell.
inline Stamp arrival_of(const Input& input, Stamp otherwise) {
  if (const auto* datagram = std::get_if<Datagram>(&input))
    return datagram->receive_stamp;
  if (const auto* imu = std::get_if<ImuInput>(&input))
    return imu->sample.arrival;
  if (const auto* odometry = std::get_if<OdometryInput>(&input))
    return odometry->sample.arrival;
  if (const auto* silence = std::get_if<Silence>(&input))
    return silence->now;
  return otherwise;
}

/// Where input comes from: sockets and DDS readers in the daemon, a recording in a replay. One owner.
class InputSource {
 public:
  virtual ~InputSource() = default;

  /// The next input in the order of arrival, valid until the next call; Silence if none came within `timeout`, with a
  /// time not later than the arrival of the next. Allocates nothing, throws nothing. After EndOfInput it is not called.
  virtual Input next(Duration timeout) = 0;

  /// To be told now and then of the lidars as they are known by now; for who can tell others from them.
  virtual void expect(const LidarRouter& /*lidars*/) {}
};

} // namespace locus::daemon
