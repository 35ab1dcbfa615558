// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>
#include <string>

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

namespace locus::test {

/// A DDS domain that no other test on this machine uses at the same time, of any user.
class DdsDomain {
 public:
  DdsDomain() {
    constexpr int kFirst = 20, kLast = 99; // their ports lie below the ephemeral range
    for (number_ = kFirst; number_ <= kLast; ++number_) {
      const std::string file = "/tmp/locus-test-dds-domain-" + std::to_string(number_);
      lock_ = open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
      if (lock_ >= 0 && flock(lock_, LOCK_EX | LOCK_NB) == 0)
        return;
      if (lock_ >= 0)
        close(lock_);
    }
    throw std::runtime_error("no free DDS domain");
  }
  ~DdsDomain() { close(lock_); }
  DdsDomain(const DdsDomain&) = delete;
  DdsDomain& operator=(const DdsDomain&) = delete;

  [[nodiscard]] int number() const { return number_; }

 private:
  int number_ = 0;
  int lock_ = -1;
};

} // namespace locus::test
