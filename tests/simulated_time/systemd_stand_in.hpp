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

/// What systemd does for the service, after systemd/locusd.service: WatchdogSec=5, Restart=on-failure,
/// RestartSec=500ms. Any thread.
class SystemdStandIn {
 public:
  /// One life of the service.
  struct Life {
    int number = 0; ///< from 1
    pid_t pid = 0;
    Duration since{}; ///< CLOCK_MONOTONIC
  };

  SystemdStandIn(std::vector<std::string> command, const std::filesystem::path& notify_socket);
  ~SystemdStandIn();
  SystemdStandIn(const SystemdStandIn&) = delete;
  SystemdStandIn& operator=(const SystemdStandIn&) = delete;

  /// To the process, if there is one: whether there was.
  bool signal(int number);
  /// Nothing while there is none.
  [[nodiscard]] std::optional<Life> life() const;
  [[nodiscard]] std::uint64_t watchdog_kills() const { return watchdog_kills_; }
  /// What the service has said since the last call, in all its lives; and how each of them ended that ended: "exit N".
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
  std::size_t lines_taken_ = 0; ///< of this life
  std::atomic<std::uint64_t> watchdog_kills_{0};
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

} // namespace locus::test
