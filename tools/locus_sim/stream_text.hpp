// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "drivers/net/datagram.hpp"

namespace locus::sim {

/// Source and destination of texts in a stream: this host's discard port, never that of a lidar.
inline constexpr std::uint32_t kTextAddress = 0x7F00'0001;
inline constexpr std::uint16_t kTextPort = 9;

/// Whole lines to append to one of the files of a capture folder, as in a stream (see StreamSink). Does not own its
/// data.
struct StreamText {
  std::string_view file;
  std::string_view lines;

  /// Returns nothing if the datagram is not a text.
  static std::optional<StreamText> of(const Datagram& datagram) {
    if (datagram.source_ip != kTextAddress || datagram.destination_port != kTextPort)
      return std::nullopt;
    const std::string_view payload{reinterpret_cast<const char*>(datagram.payload.data()), datagram.payload.size()};
    const std::size_t name_ends = payload.find('\n');
    if (name_ends == std::string_view::npos)
      return std::nullopt;
    return StreamText{payload.substr(0, name_ends), payload.substr(name_ends + 1)};
  }
};

} // namespace locus::sim
