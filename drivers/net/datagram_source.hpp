// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "drivers/net/datagram.hpp"

namespace locus {

/// The datagrams of a recording, whatever the format of its file, in the order in which they came. One owner.
class DatagramSource {
 public:
  virtual ~DatagramSource() = default;

  /// The next datagram, valid until the next call; nullptr at the end.
  virtual const Datagram* next() = 0;

  /// How many next() has given out.
  [[nodiscard]] virtual std::uint64_t datagrams() const = 0;

  /// Why there was none at all: what was seen in their place and what to do, for the user.
  [[nodiscard]] virtual std::string why_none() const = 0;

  /// One line each about what was met so far and the user can do something about.
  [[nodiscard]] virtual std::vector<std::string> warnings() const = 0;

  /// Share of the file that has been read, 0..1; 0 where its length is not known (a pipe).
  [[nodiscard]] virtual double progress() const = 0;
};

} // namespace locus
