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

/// Error that ends the program. Each line of what() is for the user: the mistake, its location, the remedy.
class Failure : public std::runtime_error {
 public:
  Failure(ExitStatus status, const std::string& what) : std::runtime_error(what), status_(status) {}
  [[nodiscard]] ExitStatus status() const { return status_; }

 private:
  ExitStatus status_;
};

/// Flushes stdout; throws if output is lost, as on a full disk. Call at the end of the program.
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
