// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "drivers/net/datagram.hpp"

namespace locus::sim {

/// Where the texts in a stream come from and go to: this host's discard port, so that nobody takes them for a lidar's.
inline constexpr std::uint32_t kTextAddress = 0x7F00'0001;
inline constexpr std::uint16_t kTextPort = 9;

/// Whole lines to be appended to one of the files of a capture folder, as they stand in a stream (see StreamSink). Owns
/// nothing.
struct StreamText {
  std::string_view file;
  std::string_view lines;

  /// Nothing for what is no text.
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
