// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>

#include <dds/dds.h>

#include "core/base/stamp.hpp"
#include "daemon/dds/dds_node.hpp"

namespace locus::daemon {

/// Whose samples a topic takes: of one writer, the first, until it is silent or gone, and no more than any sensor
/// sends. What a second writer sends, however much, is counted and comes no further. One owner.
class Admission {
 public:
  /// Whether the sample of `writer` that came at `now` is taken; else it is counted.
  bool admits(dds_instance_handle_t writer, Stamp now) {
    if (writer != writer_ && now - last_heard_ < kSilence)
      return refuse();
    writer_ = writer;
    last_heard_ = now;
    if (now - window_began_ >= kWindow || now < window_began_) {
      window_began_ = now;
      in_window_ = 0;
    }
    return ++in_window_ <= kMostInWindow || refuse();
  }
  [[nodiscard]] std::uint64_t refused() const { return refused_; }

  /// Another writer may take over from one that `reader` hears no more.
  template <class Message> void look_after(const DdsReader<Message>& reader) {
    if (!reader.hears(writer_))
      last_heard_ = {};
  }

 private:
  static constexpr Duration kSilence = std::chrono::seconds{2}; ///< longer than the period of any source
  static constexpr Duration kWindow = std::chrono::milliseconds{100};
  static constexpr std::uint32_t kMostInWindow = 1000; ///< 10 kHz

  bool refuse() {
    ++refused_;
    return false;
  }

  dds_instance_handle_t writer_ = 0;
  Stamp last_heard_, window_began_;
  std::uint32_t in_window_ = 0;
  std::uint64_t refused_ = 0;
};

} // namespace locus::daemon
