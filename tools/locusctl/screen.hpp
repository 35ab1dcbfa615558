// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string_view>

#include <termios.h>

#include "core/base/stamp.hpp"

namespace locus::tools {

/// Takes over the terminal for its lifetime: alternate screen, redrawn repeatedly, without echo of keys; the destructor
/// restores the terminal. One owner, one at a time.
class Screen {
 public:
  /// Throws Failure without a terminal.
  Screen();
  ~Screen();
  Screen(const Screen&) = delete;
  Screen& operator=(const Screen&) = delete;

  /// Overwrites the previous text without flicker; truncates what does not fit.
  void show(std::string_view text);

  /// Returns whether the user quit by q or Ctrl-C, or the terminal is gone; waits up to `timeout`.
  bool wait_for_end(Duration timeout);

 private:
  std::optional<termios> original_settings_; ///< original settings; nothing if stdin is not a terminal
};

} // namespace locus::tools
