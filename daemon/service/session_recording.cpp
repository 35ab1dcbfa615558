// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <memory>

#include <fmt/format.h>

#include "daemon/service/session.hpp"

namespace locus::daemon {

std::filesystem::path record_folder(const std::filesystem::path& folder) {
  const auto state = state_path();
  return state ? state->parent_path() / folder : folder;
}

/// Starts a recording. A run holds the input of the odometry from start or reset to stop, so that its replay gives the
/// same poses. Incidents use the recording to a folder if there is one, otherwise a ring in memory.
InputSource& Session::begin_recording() {
  recorder_.reset(); // its pipeline is stopped
  records_to_memory_ = old_ring_removed_ = false;
  const RecordOptions& options = config_.record;
  const Duration keep = incidents_ != nullptr ? from_seconds(options.keep_s) : Duration{};
  if (options.folder.empty() && keep == Duration{})
    return input_;
  if (options.folder.empty()) {
    const auto bounds = ring_bounds(options.keep_bytes, keep);
    if (!bounds) {
      log_.warn(bounds.error());
      return input_;
    }
    records_to_memory_ = true;
    return record_to(ring_folder(), *bounds);
  }
  const auto files = sample_files(config_);
  for (std::size_t i = 0; i < files.size(); ++i)
    if (!files[i] && !config_.motion_sources[i].of_lidar)
      log_.warn(fmt::format("motion source {}: is not recorded: a recording holds one IMU, the first",
                            config_.motion_sources[i].name));
  return record_to(record_folder(options.folder),
                   {options.max_bytes, keep == Duration{} ? RecordingBounds::kForEver : keep});
}

InputSource& Session::record_to(const std::filesystem::path& folder, const RecordingBounds& bounds) {
  recorder_ = std::make_unique<Recorder>(folder, config_, bounds);
  return recording_input_.emplace(input_, *recorder_);
}

bool Session::stores_incidents() const {
  return incidents_ != nullptr && recorder_ != nullptr && config_.record.keep_s > 0;
}

/// Disk thread: writes states, incidents and the recording. Incidents precede the recording, so that the pieces they
/// link are complete and not yet removed. A ring of an earlier session is removed once no incident is being written.
void Session::write_to_disk(bool last_round) {
  state_saver_.write();
  if (incidents_ != nullptr) {
    incidents_->work(recorder_.get());
    if (!records_to_memory_ && !old_ring_removed_ && incidents_->status().writing.empty()) {
      remove_mark_and_ring();
      old_ring_removed_ = true;
    }
  }
  if (!recorder_)
    return;
  recorder_->write(last_round);
  if (stores_incidents() && (records_to_memory_ || old_ring_removed_))
    mark_run(recorder_->status().run);
}

} // namespace locus::daemon
