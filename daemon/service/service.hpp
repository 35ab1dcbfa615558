// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/config_yaml.hpp"
#include "daemon/service/control_server.hpp"
#include "daemon/service/log.hpp"
#include "daemon/service/session.hpp"
#include "daemon/service/watch.hpp"

namespace locus::daemon {

/// Without a file, every key has its default.
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
  bool begin(const Config& config, std::optional<SavedState> state);
  [[nodiscard]] std::optional<SavedState> recent_state();
  void keep_state(std::optional<SavedState> state);
  std::optional<ControlServer::Answer> answer(const nlohmann::json& request);
  std::optional<ControlServer::Answer> answer_map();
  /// Takes the configuration file again; a bad one leaves the old configuration in force, and that is said.
  std::optional<std::string> reload();
  void look_after();
  void tell_world();
  bool take_signal();

  std::filesystem::path config_file_;
  Log& log_;
  std::vector<int> inherited_;
  int signals_; ///< signalfd
  std::unique_ptr<Session> session_;
  std::optional<ControlServer> control_;
  bool map_asked_ = false;
  std::optional<Watch> watch_;
  Watchdog watchdog_;
  Duration told_{};
  std::optional<TrackingState> told_state_;
};

} // namespace locus::daemon
