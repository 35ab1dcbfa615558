// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string_view>

#include <termios.h>

#include "core/base/stamp.hpp"

namespace locus::tools {

/// The whole terminal, for as long as it lives: a page of its own that is drawn over and over, and keys that are not
/// echoed. Then the terminal is as it was. One owner, one at a time.
class Screen {
 public:
  /// Throws Failure where there is no terminal.
  Screen();
  ~Screen();
  Screen(const Screen&) = delete;
  Screen& operator=(const Screen&) = delete;

  /// Over what was there, so that nothing flickers; what does not fit is left out.
  void show(std::string_view text);

  /// Whether the user has had enough, by q or Ctrl-C, or the terminal is gone; waits for that.
  bool wait_for_end(Duration timeout);

 private:
  std::optional<termios> found_; ///< how the keys were; nothing if they come from elsewhere
};

} // namespace locus::tools
