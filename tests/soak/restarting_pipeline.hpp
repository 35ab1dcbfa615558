// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <optional>

#include "config/config.hpp"
#include "daemon/live_pipeline.hpp"
#include "daemon/service/state_saver.hpp"
#include "piece.hpp"
#include "support/held_input.hpp"

namespace locus::soak {

/// The live threads and their saved state, stopped and restarted as systemd does with the service. Not thread-safe.
class RestartingPipeline {
 public:
  using Take = std::function<void(const daemon::ProcessedSweep&)>;

  /// `input` must outlive this; `take` receives every estimate.
  RestartingPipeline(Config config, daemon::InputSource& input, std::filesystem::path state_file, Take take);
  ~RestartingPipeline();
  RestartingPipeline(const RestartingPipeline&) = delete;
  RestartingPipeline& operator=(const RestartingPipeline&) = delete;

  /// Resumes from the state file if there is one that is not later than `now`; else starts without a state.
  void begin(Stamp now);

  enum class End { orderly, crash };
  /// A crash leaves only the content of the file.
  void end(End how);

  /// Passes on the available estimates, and those that arrive within `timeout`.
  void fetch(Duration timeout);

  /// Returns whether every sweep so far has become an estimate that was passed on.
  [[nodiscard]] bool is_idle() const;

  /// Returns the counts of all pipelines so far, without the inputs given. Call only while the input is at rest.
  Counts counts();

  /// Returns whether the first sweep after the last begin() was relocalised in the saved map.
  [[nodiscard]] bool has_resumed() const { return resumed_.load(std::memory_order_relaxed); }

 private:
  void wait_for_disk(const ResumeState& last) const;
  [[nodiscard]] Counts with(const daemon::IngestReport& report) const;

  Config config_;
  test::PatientInput input_;
  std::filesystem::path state_file_;
  Take take_;
  std::optional<daemon::StateSaver> state_saver_;
  std::optional<daemon::Worker> disk_;
  std::optional<daemon::LivePipeline> pipeline_;
  std::atomic<bool> resumed_{false};
  Counts before_; ///< of the stopped pipelines
  std::uint64_t fetched_ = 0;
};

} // namespace locus::soak
