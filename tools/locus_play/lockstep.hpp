// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/base/stamp.hpp"

namespace locus::tools {

/// Prevents a player from running ahead of a service that cannot keep pace, by polling its progress on the control
/// socket. One owner.
class Lockstep {
 public:
  explicit Lockstep(std::filesystem::path socket) : socket_(std::move(socket)) {}

  /// Waits until the service knows a publisher of each of these motion sources. Throws Failure on timeout.
  void wait_for_writers(const std::vector<std::string>& sources) const;

  /// Waits until the service has processed each sweep that it received. Call twice per sweep, before waiting for `now`,
  /// the time of the recording. Throws Failure if the service is gone.
  void wait_until_processed(Stamp now);

 private:
  std::filesystem::path socket_;
  Stamp checked_at_ = Stamp::min();
};

} // namespace locus::tools
