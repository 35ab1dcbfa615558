// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <optional>

#include "config/config.hpp"
#include "daemon/live_pipeline.hpp"
#include "daemon/service/saved_state.hpp"
#include "piece.hpp"
#include "support/held_input.hpp"

namespace locus::soak {

/// The live threads and the state kept of them, ended and begun again as systemd does it with the service. One owner.
class RestartingPipeline {
 public:
  using Take = std::function<void(const daemon::ProcessedSweep&)>;

  /// `input` must outlive this; `take` gets every estimate.
  RestartingPipeline(Config config, daemon::InputSource& input, std::filesystem::path state_file, Take take);
  ~RestartingPipeline();
  RestartingPipeline(const RestartingPipeline&) = delete;
  RestartingPipeline& operator=(const RestartingPipeline&) = delete;

  /// Goes on from the state in the file, if there is one and it is not of a time after `now`; else anew.
  void begin(Stamp now);

  enum class End { orderly, crash };
  /// In a crash what lies in the file is all that is left.
  void end(End how);

  /// Hands on the estimates that are there, or come within `timeout`.
  void fetch(Duration timeout);

  /// Whether every sweep that is there has become an estimate that was handed on.
  [[nodiscard]] bool is_idle() const;

  /// Of all that was begun; what was given is not known here. While the input is at rest.
  Counts counts();

  /// Whether the first sweep after the last begin() was found in the map of the state.
  [[nodiscard]] bool has_resumed() const { return resumed_.load(std::memory_order_relaxed); }

 private:
  void wait_for_disk(const Whereabouts& last) const;
  [[nodiscard]] Counts with(const daemon::IngestReport& report) const;

  Config config_;
  test::PatientInput input_;
  std::filesystem::path state_file_;
  Take take_;
  std::optional<daemon::StateKeeper> keeper_;
  std::optional<daemon::Worker> disk_;
  std::optional<daemon::LivePipeline> pipeline_;
  std::atomic<bool> resumed_{false};
  Counts before_; ///< of the pipelines that have ended
  std::uint64_t fetched_ = 0;
};

} // namespace locus::soak
