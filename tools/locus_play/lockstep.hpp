// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/base/stamp.hpp"

namespace locus::tools {

/// Keeps a player from running ahead of a service that cannot keep pace: it asks its control socket how far it is. One
/// owner.
class Lockstep {
 public:
  explicit Lockstep(std::filesystem::path socket) : socket_(std::move(socket)) {}

  /// Until the service knows a publisher of each of these motion sources. Throws Failure when it never does.
  void wait_for_writers(const std::vector<std::string>& sources) const;

  /// To be called before `now`, of the recording, is waited for: twice in a sweep, until each sweep that the service
  /// has seen is processed. Throws Failure when the service is gone.
  void follow(Stamp now);

 private:
  std::filesystem::path socket_;
  Stamp asked_ = Stamp::min();
};

} // namespace locus::tools
