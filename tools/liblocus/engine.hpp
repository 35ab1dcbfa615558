// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <functional>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "daemon/figures.hpp"
#include "daemon/inline_pipeline.hpp"
#include "daemon/machine_time.hpp"
#include "liblocus/liblocus.hpp"

namespace locus::library {

/// Common part of the library's Odometry and Replay: inputs in, estimates in the form of the library out. One owner.
class Engine {
 public:
  /// Expects `lidars` opened from config.lidars.
  Engine(Config config, LidarRouter lidars);
  Engine(const Engine&) = delete;
  Engine& operator=(const Engine&) = delete;

  void process(const daemon::Input& input) { pipeline_.process(input); }

  /// Estimates not fetched yet, the oldest first.
  [[nodiscard]] std::deque<liblocus::Estimate>& completed() { return completed_; }

  [[nodiscard]] const Config& config() const { return config_; }
  [[nodiscard]] const daemon::Ingest& ingest() const { return pipeline_.ingest(); }
  [[nodiscard]] std::vector<liblocus::Surface> scan() const;
  [[nodiscard]] std::vector<liblocus::Surface> map() const;
  /// Returns the figures so far; the engine must outlive them.
  [[nodiscard]] daemon::Figures figures() const;

 private:
  void add_result(const daemon::ProcessedSweep& done);

  Config config_;
  std::vector<std::string> source_names_;
  daemon::MachineTime begin_ = daemon::MachineTime::now();
  daemon::SweepStatistics tally_;
  std::deque<liblocus::Estimate> completed_;
  daemon::InlinePipeline pipeline_;
};

/// Formats the figures as JSON for the user.
std::string to_json_text(const daemon::Figures& figures);

/// Does the work; converts its errors to liblocus::Error.
void in_words_of_the_library(const std::function<void()>& work);

} // namespace locus::library
