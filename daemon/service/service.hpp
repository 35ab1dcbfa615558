// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/config_yaml.hpp"
#include "daemon/service/control.hpp"
#include "daemon/service/log.hpp"
#include "daemon/service/session.hpp"
#include "daemon/service/status.hpp"

namespace locus::daemon {

/// Without a file, every key has its default. What it names has been read, too: the calibrations of the lidars.
Expected<Config, ConfigErrors> read_config(const std::filesystem::path& file);

/// The life of the service in the main thread: start, look after the session, reload, stop.
class Service {
 public:
  Service(std::filesystem::path config_file, Log& log);
  ~Service();
  Service(const Service&) = delete;
  Service& operator=(const Service&) = delete;

  /// Until SIGTERM or SIGINT; the exit status.
  int run(const Config& config);

 private:
  /// What failed, if anything did: there is no session then.
  std::optional<std::string> begin(const Config& config, std::optional<SavedState> state);
  [[nodiscard]] std::optional<SavedState> recent_state();
  void keep_state(const std::optional<SavedState>& state);
  std::optional<ControlServer::Answer> answer(const ControlRequest& request);
  std::optional<ControlServer::Answer> answer(ShowStatus request);
  std::optional<ControlServer::Answer> answer(SaveMap request);
  std::optional<ControlServer::Answer> answer(SetFlatGround request);
  std::optional<ControlServer::Answer> answer(const Reset& request);
  std::optional<ControlServer::Answer> answer(Reload request);
  /// Takes the configuration file again; a bad one leaves the old configuration in force, and that is said.
  ControlServer::Answer reload();
  std::optional<std::string> go_on_with(const Config& config);
  void look_after();
  bool take_signal();

  std::filesystem::path config_file_;
  Log& log_;
  std::vector<int> inherited_;
  int signals_; ///< signalfd
  std::unique_ptr<Session> session_;
  std::optional<ControlServer> control_;
  std::optional<Duration> map_asked_; ///< when the session was; nothing: no answer is waited for
  std::optional<Watch> watch_;
  Watchdog watchdog_;
  Duration told_{};
  std::optional<TrackingState> told_state_;
};

} // namespace locus::daemon
