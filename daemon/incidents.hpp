// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/expected.hpp"
#include "core/base/names.hpp"
#include "core/base/stamp.hpp"
#include "daemon/descriptor.hpp"
#include "daemon/recorder.hpp"

namespace locus::daemon {

/// Reason for storing an incident: a user request, loss of tracking, a contradiction between a motion source and lidar,
/// or an unclean end of the previous run.
enum class IncidentCause : std::uint8_t { asked, tracking_lost, contradiction, restart };
constexpr auto names_of(IncidentCause) {
  return std::to_array<std::string_view>({"asked", "tracking_lost", "contradiction", "restart"});
}

/// Stores the input before an incident in FOLDER/TIME_CAUSE: pieces of a recording and why.json.
///
/// The pieces are hard-linked at once, next to the recording, so that they survive while the recording continues; then
/// they are renamed into the folder, or copied in steps if that is on another file system. An incomplete incident has
/// the suffix `.part`. The oldest incidents are removed until the new one fits and its size again stays free on the
/// disk. One owner makes requests; another thread, which may block on the disk, does the work.
class Incidents {
 public:
  static constexpr std::size_t kMaxIncidents = 32; ///< largest number of incidents in the folder
  /// Least time between two incidents of one cause, except requested ones. Holds across restarts, so that a crash loop
  /// does not fill the disk.
  static constexpr Duration kMinInterval = std::chrono::minutes{5};

  struct Request {
    IncidentCause cause = IncidentCause::asked;
    Duration keep{};                             ///< length of the input to store, up to now
    Stamp when;                                  ///< CLOCK_REALTIME
    std::string report;                          ///< contents of why.json
    std::vector<std::filesystem::path> pieces{}; ///< empty: the recorder's pieces
  };
  struct Status {
    std::filesystem::path last;    ///< last complete incident of this process; empty: none
    std::filesystem::path writing; ///< incident being written; empty: none
    std::uint64_t stored = 0;      ///< incidents stored by this process
    std::uint64_t suppressed = 0;  ///< automatic incidents too soon after another
    std::uint64_t dropped = 0;     ///< inputs missing in the buffer for the next incident, see Recorder::Status
    std::string problem;           ///< failure of the last automatic incident; cleared by the next stored one
    std::string refusal;           ///< failure of the last requested incident; empty on success
  };

  /// Reads the times of the last incidents and removes incomplete ones of earlier processes.
  explicit Incidents(std::filesystem::path folder);
  Incidents(const Incidents&) = delete;
  Incidents& operator=(const Incidents&) = delete;

  /// Owner: sets the limit for all incidents together, from the next one on.
  void set_max_bytes(std::uint64_t max_bytes);
  /// Owner: requests an incident. Returns its future folder, or one line for the user while another is being written.
  Expected<std::filesystem::path, std::string> submit(Request request);
  /// Owner: requests an automatic incident, unless it is too soon. Tells whether it was accepted.
  bool raise(Request request);
  /// Returns the status. Any thread.
  [[nodiscard]] Status status() const;

  /// Disk thread (the recorder's), periodically: starts a pending request or copies a limited amount of data.
  void work(Recorder* recorder);

 private:
  /// Incident being written.
  struct Job {
    Request request;
    std::filesystem::path snapshot, part, target;
    std::vector<std::filesystem::path> files; ///< files still to be copied, relative to snapshot
    Descriptor in{}, out{};                   ///< source and copy of files.back()
  };

  bool accept(Request request);
  std::optional<std::string> begin(Request request, Recorder* recorder);
  std::optional<std::string> make_room(std::uint64_t bytes) const;
  std::optional<std::string> copy_files();
  std::optional<std::string> finish();
  void end(const std::string& problem);

  std::filesystem::path folder_;
  std::optional<Job> job_; ///< owned by the disk thread

  mutable std::mutex mutex_; ///< guards all members below
  std::uint64_t max_bytes_ = 0;
  std::optional<Request> pending_;
  bool is_requested_ = false; ///< the incident being written was requested; otherwise automatic
  std::array<std::optional<Stamp>, names_of(IncidentCause{}).size()> last_raised_; ///< by cause
  Status status_;
};

/// Returns the temporary folder for links to the pieces of a folder of runs; its name cannot clash with a user's file.
std::filesystem::path snapshot_in(const std::filesystem::path& folder_of_runs);

/// Returns, in order, the pieces with the last `keep` of a run that another process left behind.
std::vector<std::filesystem::path> last_pieces(const std::filesystem::path& run, Duration keep);

} // namespace locus::daemon
