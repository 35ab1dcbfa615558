// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <sys/types.h>

#include "support/temporary_folder.hpp"

namespace locus::test {

/// The robot's computer: network and file systems private to this program. Lidar packets arrive by `lo`; the cable
/// `dds0` leads to another computer, 10.9.1.2, which runs the DDS peers.
class RobotComputer {
 public:
  /// Throws std::runtime_error if the system does not permit it. Precondition: this is the only thread.
  RobotComputer();
  ~RobotComputer();
  RobotComputer(const RobotComputer&) = delete;
  RobotComputer& operator=(const RobotComputer&) = delete;

  /// Runs a function in the network namespace of the other computer; sockets opened there stay in it.
  void over_there(const std::function<void()>& run) const;
  /// Returns a command that runs there.
  [[nodiscard]] std::vector<std::string> there(std::vector<std::string> command) const;

  void set_link(bool up) const;
  /// Fills the file system of state(), or frees it again.
  void set_disk_full(bool full) const;

  [[nodiscard]] std::filesystem::path state() const { return folder_ / "state"; } ///< a file system of 48 MB
  [[nodiscard]] std::filesystem::path file(const std::string& name) const { return folder_ / name; }

 private:
  TemporaryFolder folder_;
  int here_ = -1, there_ = -1; ///< network namespaces
};

} // namespace locus::test
