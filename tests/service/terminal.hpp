// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <sys/types.h>
#include <termios.h>

#include "support/patience.hpp"

namespace locus::test {

/// A terminal of 24 rows and 80 columns with one program in it, and its visible contents. Supports only the control
/// sequences needed by a page that is redrawn in place.
class Terminal {
 public:
  static constexpr std::size_t kRows = 24, kColumns = 80;

  explicit Terminal(std::vector<std::string> command);
  ~Terminal();
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  void type(std::string_view keys) const;

  /// Waits until it holds for the rows; false after the test's patience.
  bool wait_until(const std::function<bool()>& holds);
  bool shows(const std::string& text);
  std::optional<int> wait_for_exit();

  [[nodiscard]] bool on_page_of_its_own() const { return on_page_of_its_own_; }
  [[nodiscard]] bool cursor_is_shown() const { return cursor_is_shown_; }
  /// Number of times that a page was started at its top.
  [[nodiscard]] int pages() const { return pages_; }
  /// Number of characters beyond the right edge and lines beyond the bottom.
  [[nodiscard]] int overflows() const { return overflows_; }
  /// Returns the current terminal settings, to compare with those before the program started.
  [[nodiscard]] termios settings() const;
  [[nodiscard]] const termios& settings_before() const { return settings_before_; }

 private:
  void read_some(Duration timeout);
  void take(char c);
  void obey(const std::string& sequence);

  int master_ = -1, slave_ = -1;
  termios settings_before_{};
  pid_t pid_ = 0;
  std::optional<int> status_;
  std::vector<std::string> rows_{kRows, std::string(kColumns, ' ')};
  std::size_t row_ = 0, column_ = 0;
  std::optional<std::string> escape_; ///< incomplete control sequence
  bool on_page_of_its_own_ = false, cursor_is_shown_ = true;
  int pages_ = 0, overflows_ = 0;
};

} // namespace locus::test
