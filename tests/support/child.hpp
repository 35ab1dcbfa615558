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

/// Another program that runs beside the test, whose lines (stdout and stderr as one) are heard as they come. Gone at
/// the end of the test, whatever happens.
class Child {
 public:
  explicit Child(std::vector<std::string> command);
  ~Child();
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  void close_stdin();
  void signal(int number) const;

  /// Exit status, 128 + signal if one ended it; nothing while it still runs at the end of the test's patience. All
  /// lines of a program that ended are read.
  std::optional<int> wait_for_exit(Duration timeout = patience());

  /// So far.
  [[nodiscard]] std::vector<std::string> lines() const;
  /// Those that begin with this word and a space, without it.
  [[nodiscard]] std::vector<std::string> lines_of(const std::string& word) const;
  [[nodiscard]] bool has_line(const std::string& part) const;
  /// Whether it comes true of the lines before the test's patience ends.
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
