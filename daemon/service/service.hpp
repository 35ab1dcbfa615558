// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/config_yaml.hpp"
#include "daemon/service/control.hpp"
#include "daemon/service/incident_watch.hpp"
#include "daemon/service/log.hpp"
#include "daemon/service/metrics_server.hpp"
#include "daemon/service/session.hpp"
#include "daemon/service/status.hpp"

namespace locus::daemon {

/// Reads the configuration and the files that it names, to validate them. Without a file every key has its default.
Expected<Config, ConfigErrors> read_config(const std::filesystem::path& file);

/// Main loop of the service: start, supervision of the session, reload, stop. Main thread only.
class Service {
 public:
  Service(std::filesystem::path config_file, Log& log);
  ~Service();
  Service(const Service&) = delete;
  Service& operator=(const Service&) = delete;

  /// Runs until SIGTERM or SIGINT; returns the exit status.
  int run(const Config& config);

 private:
  void open_control();
  /// Starts a session. Returns the failure, if any; there is no session then.
  std::optional<std::string> begin(const Config& config, std::optional<SavedState> state);
  [[nodiscard]] std::optional<SavedState> recent_state();
  void save_state(const std::optional<SavedState>& state);
  void store_crashed_run(const Config& config, const std::optional<SavedState>& state);
  void finish_incident();
  void check_for_incidents(const Figures& figures);
  std::optional<ControlServer::Answer> answer(const ControlRequest& request);
  std::optional<ControlServer::Answer> answer(ShowStatus request);
  std::optional<ControlServer::Answer> answer(SaveMap request);
  std::optional<ControlServer::Answer> answer(ShowSweep request);
  std::optional<ControlServer::Answer> answer(SetFlatGround request);
  std::optional<ControlServer::Answer> answer(const Reset& request);
  std::optional<ControlServer::Answer> answer(Reload request);
  std::optional<ControlServer::Answer> answer(StoreIncident request);
  /// Rereads the configuration file; an invalid one leaves the old configuration in effect and is reported.
  ControlServer::Answer reload();
  std::optional<std::string> restart_with(const Config& config);
  void serve_metrics(const std::string& address);
  void supervise();
  void follow_address();
  bool handle_signals();

  std::filesystem::path config_file_;
  Log& log_;
  std::vector<int> inherited_;
  int signals_;                          ///< signalfd
  std::atomic<std::uint64_t> resets_{0}; ///< Figures::Live::resets
  std::optional<Incidents> incidents_;   ///< empty without a state directory or control socket
  IncidentWatch incident_watch_;
  Incidents::Status logged_incidents_;
  std::unique_ptr<Session> session_;
  std::optional<ControlServer> control_;
  std::unique_ptr<MetricsServer> metrics_;
  std::string metrics_address_;              ///< address of the last attempt to listen
  std::optional<Duration> map_requested_at_; ///< time of the pending map request, CLOCK_MONOTONIC; empty: none
  std::optional<SessionMonitor> monitor_;
  std::optional<std::string> dds_address_; ///< of the interface when DDS connected
  Duration address_checked_at_{};          ///< CLOCK_MONOTONIC
  Watchdog watchdog_;
  Duration reported_at_{};
  std::optional<TrackingState> reported_state_;
};

} // namespace locus::daemon
