// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <ctime>
#include <initializer_list>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>

#include "core/base/stamp.hpp"
#include "daemon/machine_time.hpp"

namespace locus::daemon {

/// As syslog numbers them.
enum class Severity : std::uint8_t { error = 3, warning = 4, notice = 5, info = 6 };

/// A place in the program: std::source_location, which clang has not yet.
struct CodePlace {
  const char* file;
  std::uint32_t line;
  const char* function;

  static constexpr CodePlace current(const char* file = __builtin_FILE(), std::uint32_t line = __builtin_LINE(),
                                     const char* function = __builtin_FUNCTION()) {
    return {file, line, function};
  }
};

/// What the service tells those who look after it: to the journal with fields where stderr leads there, else as a line
/// of text to stderr.
///
/// Each message says what happened and, unless all is well, what to do. A place in the program that says more than
/// kBurst messages within kInterval is silenced until that is over, and then tells how many were left out.
/// Any thread but those of the packet path.
class Log {
 public:
  using Fields = std::initializer_list<std::pair<std::string_view, std::string>>; ///< names in capitals: LOCUS_SOURCE
  static constexpr int kBurst = 5;

  static constexpr Duration kInterval = std::chrono::seconds{10};

  using Clock = Duration (*)(clockid_t); ///< read_clock(), or another in tests
  explicit Log(Clock clock = [](clockid_t id) { return read_clock(id); });

  void say(Severity severity, const std::string& message, Fields fields = {},
           const CodePlace& where = CodePlace::current());
  void error(const std::string& message, Fields fields = {}, const CodePlace& where = CodePlace::current()) {
    say(Severity::error, message, fields, where);
  }
  void warn(const std::string& message, Fields fields = {}, const CodePlace& where = CodePlace::current()) {
    say(Severity::warning, message, fields, where);
  }
  void info(const std::string& message, Fields fields = {}, const CodePlace& where = CodePlace::current()) {
    say(Severity::info, message, fields, where);
  }

 private:
  struct Site {
    Duration since{};
    int said = 0;
    std::uint64_t silenced = 0;
  };

  [[nodiscard]] bool may_speak(const CodePlace& where, std::uint64_t& silenced_before);
  void write(Severity severity, const std::string& message, Fields fields, const CodePlace& where) const;

  Clock clock_;
  bool to_journal_;
  std::mutex mutex_;
  std::map<std::pair<std::string_view, std::uint32_t>, Site> sites_; ///< by file and line
};

} // namespace locus::daemon
