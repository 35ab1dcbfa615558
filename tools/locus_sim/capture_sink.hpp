// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "core/base/stamp.hpp"
#include "drivers/net/datagram.hpp"

namespace locus::sim {

/// Where a capture goes: to a folder, or down a pipe. Throws when it cannot be written. One owner.
class CaptureSink {
 public:
  CaptureSink() = default;
  CaptureSink(const CaptureSink&) = delete;
  CaptureSink& operator=(const CaptureSink&) = delete;
  virtual ~CaptureSink() = default;

  virtual void datagram(const Datagram& datagram) = 0;

  /// Text for one of the capture's files, by its name in a capture folder: whole lines.
  virtual void text(std::string_view file, Stamp arrival, const std::string& lines) = 0;

  /// Returns when all has been written.
  virtual void close() = 0;
};

} // namespace locus::sim
