// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "core/base/stamp.hpp"
#include "service/notify_socket.hpp"
#include "support/child.hpp"

namespace locus::test {

/// Supervises the service as systemd does by systemd/locusd.service: WatchdogSec=5, Restart=on-failure,
/// RestartSec=500ms. Any thread.
class SystemdStandIn {
 public:
  /// One process of the service.
  struct Life {
    int number = 0; ///< from 1
    pid_t pid = 0;
    Duration since{}; ///< CLOCK_MONOTONIC
  };

  SystemdStandIn(std::vector<std::string> command, const std::filesystem::path& notify_socket);
  ~SystemdStandIn();
  SystemdStandIn(const SystemdStandIn&) = delete;
  SystemdStandIn& operator=(const SystemdStandIn&) = delete;

  /// Sends a signal to the process; false if there is none.
  bool signal(int number);
  /// Returns the current process, if there is one.
  [[nodiscard]] std::optional<Life> life() const;
  [[nodiscard]] std::uint64_t watchdog_kills() const { return watchdog_kills_; }
  /// Returns the output of all processes since the previous call, with "exit N" for each process that ended.
  std::vector<std::string> new_lines();

 private:
  void run();
  void live(Child& service);
  void take_lines(const Child& service);

  std::vector<std::string> command_;
  NotifySocket notify_;
  mutable std::mutex mutex_;
  Child* service_ = nullptr; ///< while it runs
  Life life_;
  std::vector<std::string> lines_;
  std::size_t lines_taken_ = 0; ///< of this process
  std::atomic<std::uint64_t> watchdog_kills_{0};
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

} // namespace locus::test
