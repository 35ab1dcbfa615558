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

/// Why an incident is kept: somebody asked, no sweep could be registered any more, a motion source and lidar contradict
/// each other, or the run before did not end as it should.
enum class IncidentCause : std::uint8_t { asked, tracking_lost, contradiction, restart };
constexpr auto names_of(IncidentCause) {
  return std::to_array<std::string_view>({"asked", "tracking_lost", "contradiction", "restart"});
}

/// Keeps the last input before an incident: FOLDER/TIME_CAUSE, the pieces of a recording and why.json.
///
/// The pieces are linked at once, beside the recording, so that they stay while the recording goes on; then they are
/// renamed into the folder, or where that is on another disk copied bit by bit. What is not complete has the name
/// `.part`. The oldest incidents are removed until the new one fits and as much stays free on the disk. One owner asks;
/// another thread, which may be held up by the disk, works.
class Incidents {
 public:
  static constexpr std::size_t kMost = 32; ///< that the folder holds
  /// Between two of a cause, but those asked for, also over a restart: what crashes again and again fills no disk.
  static constexpr Duration kPause = std::chrono::minutes{5};

  struct Request {
    IncidentCause cause = IncidentCause::asked;
    Duration keep{};                             ///< before now
    Stamp when;                                  ///< CLOCK_REALTIME
    std::string report;                          ///< contents of why.json
    std::vector<std::filesystem::path> pieces{}; ///< empty: those of the recorder
  };
  struct Status {
    std::filesystem::path last;    ///< complete, of this process; empty: none
    std::filesystem::path writing; ///< empty: none
    std::uint64_t kept = 0;        ///< by this process
    std::uint64_t suppressed = 0;  ///< that nobody asked for and that came too soon after another
    std::uint64_t dropped = 0;     ///< inputs that are missing in what is held for the next, see Recorder::Status
    std::string problem;           ///< why one that nobody asked for could not be kept, and none since; else empty
    std::string refusal;           ///< why the last one that was asked for could not be kept; empty: it could
  };

  /// Looks when the last one was kept; what another process has not completed is removed.
  explicit Incidents(std::filesystem::path folder);
  Incidents(const Incidents&) = delete;
  Incidents& operator=(const Incidents&) = delete;

  /// Owner: of all incidents together, from the next one on.
  void set_max_bytes(std::uint64_t max_bytes);
  /// Owner: the folder where it will be; one line for the user while another one is written.
  Expected<std::filesystem::path, std::string> ask(Request request);
  /// Owner: the same for what nobody asked for, unless it is too soon. Whether it is kept.
  bool raise(Request request);
  /// Any thread.
  [[nodiscard]] Status status() const;

  /// Thread of the disk, again and again: takes what was asked for, and copies for a moment. The recorder's thread.
  void work(Recorder* recorder);

 private:
  /// What is on its way to the disk.
  struct Job {
    Request request;
    std::filesystem::path snapshot, part, target;
    std::vector<std::filesystem::path> files; ///< below snapshot, still to be copied
    Descriptor in{}, out{};                   ///< of files.back()
  };

  bool take(Request request);
  std::optional<std::string> begin(Request request, Recorder* recorder);
  std::optional<std::string> make_room(std::uint64_t bytes) const;
  std::optional<std::string> copy_some();
  std::optional<std::string> finish();
  void end(const std::string& problem);

  std::filesystem::path folder_;
  std::optional<Job> job_; ///< of the thread of the disk

  mutable std::mutex mutex_; ///< of all below
  std::uint64_t max_bytes_ = 0;
  std::optional<Request> asked_;
  bool was_asked_ = false; ///< what is being written; else it was raised
  std::array<std::optional<Stamp>, names_of(IncidentCause{}).size()> last_raised_; ///< by the cause
  Status status_;
};

/// Where the pieces that lie in a folder of runs are linked on their way: no user has such a name.
std::filesystem::path snapshot_in(const std::filesystem::path& folder_of_runs);

/// In order, the pieces of a run which another process has left behind, that hold the last so much of it.
std::vector<std::filesystem::path> last_pieces(const std::filesystem::path& run, Duration keep);

} // namespace locus::daemon
