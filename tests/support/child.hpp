// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <sys/types.h>

#include "support/patience.hpp"

namespace locus::test {

/// A child process beside the test. Its lines (stdout and stderr merged) are read as they arrive. The destructor ends
/// it.
class Child {
 public:
  explicit Child(std::vector<std::string> command);
  ~Child();
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  void close_stdin();
  void signal(int number) const;

  /// Returns the exit status, or 128 + signal; nothing if it still runs at the timeout. All lines of an ended program
  /// have been read.
  std::optional<int> wait_for_exit(Duration timeout = patience());

  /// Returns the lines read so far.
  [[nodiscard]] std::vector<std::string> lines() const;
  /// Returns the lines that begin with this word and a space, without that prefix.
  [[nodiscard]] std::vector<std::string> lines_of(const std::string& word) const;
  [[nodiscard]] bool has_line(const std::string& part) const;
  /// Waits until the predicate holds for the lines read so far; false after the test's patience.
  bool wait_until(const std::function<bool(const std::vector<std::string>&)>& holds) const;
  bool wait_for_line(const std::string& part) const;

  [[nodiscard]] pid_t pid() const { return pid_; }

 private:
  void read_lines(int descriptor);

  pid_t pid_ = 0;
  int stdin_ = -1;
  std::optional<int> status_;
  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
  std::vector<std::string> lines_;
  bool all_read_ = false;
  std::thread reader_;
};

} // namespace locus::test
