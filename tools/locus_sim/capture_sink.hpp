// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "core/base/stamp.hpp"
#include "drivers/net/datagram.hpp"

namespace locus::sim {

/// Destination of a capture: a folder or a pipe. Throws if it cannot be written. One owner.
class CaptureSink {
 public:
  CaptureSink() = default;
  CaptureSink(const CaptureSink&) = delete;
  CaptureSink& operator=(const CaptureSink&) = delete;
  virtual ~CaptureSink() = default;

  virtual void datagram(const Datagram& datagram) = 0;

  /// Appends whole lines to one of the capture's files, by its name in a capture folder.
  virtual void text(std::string_view file, Stamp arrival, const std::string& lines) = 0;

  /// Returns when everything has been written.
  virtual void close() = 0;
};

} // namespace locus::sim
