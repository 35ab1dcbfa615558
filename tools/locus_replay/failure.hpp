// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cerrno>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>

#include "core/base/expected.hpp"

namespace locus::tools {

enum class ExitStatus { done = 0, failed = 1, wrong_usage = 2 };

/// Ends the program. Each line of what() is for the user: what is wrong, where, what to do.
class Failure : public std::runtime_error {
 public:
  Failure(ExitStatus status, const std::string& what) : std::runtime_error(what), status_(status) {}
  [[nodiscard]] ExitStatus status() const { return status_; }

 private:
  ExitStatus status_;
};

/// What was printed is lost on a full disk: that is no success. To be called at the end.
inline void flush_standard_output() {
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0)
    throw Failure(ExitStatus::failed, "standard output cannot be written (" + std::generic_category().message(errno) +
                                          "); check free space");
}

template <class T> T value_or_fail(Expected<T, std::string> expected, ExitStatus status) {
  if (!expected)
    throw Failure(status, expected.error());
  return std::move(*expected);
}

} // namespace locus::tools
