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

/// Severities with the numbers of syslog.
enum class Severity : std::uint8_t { error = 3, warning = 4, notice = 5, info = 6 };

/// Source location: a substitute for std::source_location, which clang 14 lacks.
struct SourceLocation {
  const char* file;
  std::uint32_t line;
  const char* function;

  static constexpr SourceLocation current(const char* file = __builtin_FILE(), std::uint32_t line = __builtin_LINE(),
                                          const char* function = __builtin_FUNCTION()) {
    return {file, line, function};
  }
};

/// Log of the service: to the journal with fields if stderr is connected to it, otherwise as lines of text to stderr.
///
/// Each message states the event and, for a problem, the remedy. A source location that logs more than kBurst messages
/// within kInterval is suppressed for the rest of it; its next message reports the number of suppressed ones.
/// Any thread except those of the packet path.
class Log {
 public:
  using Fields = std::initializer_list<std::pair<std::string_view, std::string>>; ///< names in capitals: LOCUS_SOURCE
  static constexpr int kBurst = 5;

  static constexpr Duration kInterval = std::chrono::seconds{10};

  using Clock = Duration (*)(clockid_t); ///< read_clock(), replaceable in tests
  explicit Log(Clock clock = [](clockid_t id) { return read_clock(id); });

  void write(Severity severity, const std::string& message, Fields fields = {},
             const SourceLocation& where = SourceLocation::current());
  void error(const std::string& message, Fields fields = {}, const SourceLocation& where = SourceLocation::current()) {
    write(Severity::error, message, fields, where);
  }
  void warn(const std::string& message, Fields fields = {}, const SourceLocation& where = SourceLocation::current()) {
    write(Severity::warning, message, fields, where);
  }
  void info(const std::string& message, Fields fields = {}, const SourceLocation& where = SourceLocation::current()) {
    write(Severity::info, message, fields, where);
  }

 private:
  struct Site {
    Duration since{};
    int written = 0;
    std::uint64_t suppressed = 0;
  };

  [[nodiscard]] bool is_admitted(const SourceLocation& where, std::uint64_t& suppressed_before);
  void emit(Severity severity, const std::string& message, Fields fields, const SourceLocation& where) const;

  Clock clock_;
  bool to_journal_;
  std::mutex mutex_;
  std::map<std::pair<std::string_view, std::uint32_t>, Site> sites_; ///< by file and line
};

} // namespace locus::daemon
