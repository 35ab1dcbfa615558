// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>

namespace locus::tools {

/// Least step back of the times of a recording that is one of a clock. Less is the disorder of the recorder's threads.
inline constexpr std::chrono::nanoseconds kLeastStepBack = std::chrono::milliseconds{20};

/// Decides whether messages were received in the order of the file or in that of their times.
///
/// These differ if the recorder's clock was set back: then the times of single topics go back, a few times. Otherwise
/// the file was written topic by topic, by several threads or unordered, and the times are right. One owner.
class ReceptionOrder {
 public:
  /// Adds the next message of the file.
  void add(std::int64_t topic, std::int64_t recorded_ns);

  /// Returns whether the clock was set back, so that the order of the file is right.
  [[nodiscard]] bool is_that_of_the_file() const { return most_steps_ >= 1 && most_steps_ <= kMostSteps; }

 private:
  static constexpr std::size_t kMostSteps = 10; ///< of a clock in one recording
  struct Topic {
    std::int64_t latest_ns;
    std::size_t steps_back = 0;
  };
  std::map<std::int64_t, Topic> topics_;
  std::size_t most_steps_ = 0; ///< of one topic
};

} // namespace locus::tools
