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

/// The computer of the robot: a network and file systems of this program's own. Its lidar is heard by `lo`; by the
/// cable `dds0` it is connected to another computer, 10.9.1.2, where those live who talk DDS with it.
class RobotComputer {
 public:
  /// Throws std::runtime_error where the system does not allow that. Precondition: this is the only thread.
  RobotComputer();
  ~RobotComputer();
  RobotComputer(const RobotComputer&) = delete;
  RobotComputer& operator=(const RobotComputer&) = delete;

  /// Runs this on the other computer, whose network what it opens stays in.
  void over_there(const std::function<void()>& run) const;
  /// The command, to be run there.
  [[nodiscard]] std::vector<std::string> there(std::vector<std::string> command) const;

  void set_link(bool up) const;
  /// Fills the file system of state(), or makes room again.
  void set_disk_full(bool full) const;

  [[nodiscard]] std::filesystem::path state() const { return folder_ / "state"; } ///< a file system of 48 MB
  [[nodiscard]] std::filesystem::path file(const std::string& name) const { return folder_ / name; }

 private:
  TemporaryFolder folder_;
  int here_ = -1, there_ = -1; ///< network namespaces
};

} // namespace locus::test
