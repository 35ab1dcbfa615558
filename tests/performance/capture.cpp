// SPDX-License-Identifier: Apache-2.0
#include "capture.hpp"

#include <stdexcept>
#include <utility>
#include <variant>

namespace locus::performance {

Capture::Capture(std::string name, test::Recording recording)
    : name_(std::move(name)), recording_(std::move(recording)) {
  inputs_.assign(recording_->datagrams().begin(), recording_->datagrams().end());
  config_ = config_of_lidar_alone();
}

Capture::Capture(std::string name, SimulatedRobot& robot) : name_(std::move(name)), config_(robot.config()) {
  daemon::Input input = robot.next({});
  for (; !std::holds_alternative<daemon::EndOfInput>(input); input = robot.next({})) {
    if (auto* datagram = std::get_if<Datagram>(&input))
      datagram->payload = payloads_.emplace_back(datagram->payload.begin(), datagram->payload.end());
    inputs_.push_back(input);
  }
}

Config Capture::config_of_lidar_alone() const {
  Config config = config_;
  config.odometry.threads = 1;
  config.motion_sources.clear();
  return config;
}

} // namespace locus::performance
