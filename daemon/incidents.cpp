// SPDX-License-Identifier: Apache-2.0
#include "daemon/incidents.hpp"

#include <algorithm>
#include <cerrno>
#include <ctime>
#include <fstream>
#include <regex>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <sys/sendfile.h>
#include <unistd.h>

#include "daemon/machine_time.hpp"
#include "drivers/files/capture_folder.hpp"

namespace locus::daemon {

namespace {

using std::filesystem::path;

constexpr std::size_t kBytesPerRound = 4 << 20;

std::string store_failure_text(const path& where, const std::string& why, const char* remedy) {
  return fmt::format("{}: the incident cannot be stored ({}); {}", where.string(), why, remedy);
}

std::string store_failure_text(const path& where, const std::error_code& error) {
  return store_failure_text(where, error.message(), "let locusd write there, see INCIDENTS in locusd(8)");
}

std::string store_failure_text(const path& where, int error) {
  return store_failure_text(where, {error, std::generic_category()});
}

std::vector<path> files_below(const path& folder) {
  std::vector<path> files;
  std::error_code error;
  for (std::filesystem::recursive_directory_iterator entry{folder, error}, end; !error && entry != end;
       entry.increment(error)) {
    if (std::error_code vanished; entry->is_regular_file(vanished))
      files.push_back(entry->path().lexically_relative(folder));
  }
  return files;
}

std::uint64_t bytes_below(const path& folder) {
  std::uint64_t bytes = 0;
  for (const path& file : files_below(folder)) {
    std::error_code vanished;
    const std::uintmax_t size = std::filesystem::file_size(folder / file, vanished);
    bytes += vanished ? 0 : size;
  }
  return bytes;
}

/// Lists the incidents, oldest first; incomplete ones if `ending` matches `.part`.
std::vector<path> incidents_in(const path& folder, const std::string& ending = "") {
  const std::regex name{R"(\d{4}-\d\d-\d\dT\d\d-\d\d-\d\d\.\d{3}Z_[a-z_]+)" + ending};
  std::vector<path> found;
  std::error_code error;
  for (std::filesystem::directory_iterator entry{folder, error}, end; !error && entry != end; entry.increment(error))
    if (std::regex_match(entry->path().filename().string(), name))
      found.push_back(entry->path());
  std::ranges::sort(found);
  return found;
}

path name_of(const path& folder, Stamp when, IncidentCause cause) {
  const auto ms = std::chrono::floor<std::chrono::milliseconds>(when.time_since_epoch()).count();
  return folder / fmt::format("{:%Y-%m-%dT%H-%M-%S}.{:03}Z_{}", fmt::gmtime(static_cast<std::time_t>(ms / 1000)),
                              ms % 1000, to_string(cause));
}

/// Creates a hard link below `snapshot` for each file of the pieces.
std::error_code link_all(const std::vector<path>& pieces, const path& snapshot) {
  std::error_code error;
  std::filesystem::remove_all(snapshot, error);
  for (const path& piece : pieces) {
    std::filesystem::create_directories(snapshot / piece.filename(), error);
    for (const path& file : files_below(piece)) {
      if (error)
        return error;
      std::filesystem::create_hard_link(piece / file, snapshot / piece.filename() / file, error);
    }
  }
  return error;
}

Stamp last_write(const path& file) {
  std::error_code error;
  const auto time = std::filesystem::last_write_time(file, error);
  return error ? Stamp{} : Stamp{std::chrono::file_clock::to_sys(time).time_since_epoch()};
}

} // namespace

/// Uses the stored incident nearest to now for each cause, since the clock may have been set.
Incidents::Incidents(path folder) : folder_(std::move(folder)) {
  std::error_code ignored;
  for (const path& part : incidents_in(folder_, R"(\.part)"))
    std::filesystem::remove_all(part, ignored);
  const Stamp now{read_clock(CLOCK_REALTIME)};
  for (const path& before : incidents_in(folder_))
    for (std::size_t cause = 0; cause < last_raised_.size(); ++cause) {
      std::optional<Stamp>& last = last_raised_[cause];
      const Stamp written = last_write(before);
      if (before.filename().string().ends_with(names_of(IncidentCause{})[cause]) &&
          (!last || std::chrono::abs(written - now) < std::chrono::abs(*last - now)))
        last = written;
    }
}

void Incidents::set_max_bytes(std::uint64_t max_bytes) {
  const std::scoped_lock lock(mutex_);
  max_bytes_ = max_bytes;
}

Expected<path, std::string> Incidents::submit(Request request) {
  const std::scoped_lock lock(mutex_);
  if (!accept(std::move(request)))
    return fmt::format("{}: is still being written; try again when it is complete", status_.writing.string());
  return status_.writing;
}

bool Incidents::raise(Request request) {
  const std::scoped_lock lock(mutex_);
  auto& last = last_raised_[static_cast<std::size_t>(request.cause)];
  const Stamp when = request.when;
  const bool is_too_soon = last && std::chrono::abs(when - *last) < kMinInterval;
  if (is_too_soon || !accept(std::move(request))) {
    ++status_.suppressed;
    return false;
  }
  last = when;
  return true;
}

/// Accepts a request unless an incident is being written. Precondition: the mutex is locked.
bool Incidents::accept(Request request) {
  if (!status_.writing.empty())
    return false;
  status_.writing = name_of(folder_, request.when, request.cause);
  is_requested_ = request.cause == IncidentCause::asked;
  pending_ = std::move(request);
  return true;
}

Incidents::Status Incidents::status() const {
  const std::scoped_lock lock(mutex_);
  return status_;
}

void Incidents::work(Recorder* recorder) {
  if (job_) {
    if (const auto problem = copy_files())
      end(*problem);
    return;
  }
  std::optional<Request> request;
  {
    const std::scoped_lock lock(mutex_);
    request = std::exchange(pending_, std::nullopt);
  }
  if (!request)
    return;
  if (const auto problem = begin(std::move(*request), recorder))
    end(*problem);
}

std::optional<std::string> Incidents::begin(Request request, Recorder* recorder) {
  if (request.pieces.empty() && recorder != nullptr)
    request.pieces = recorder->end_pieces(request.keep);
  const path target = status().writing;
  if (request.pieces.empty())
    return store_failure_text(target, "no input was received", "check with locusctl status that sensors send");
  std::error_code error;
  std::filesystem::create_directories(folder_, error);
  if (error)
    return store_failure_text(folder_, error);
  const path snapshot = snapshot_in(request.pieces.front().parent_path().parent_path());
  if ((error = link_all(request.pieces, snapshot)))
    return store_failure_text(snapshot, error);
  job_ = Job{std::move(request), snapshot, target.string() + ".part", target, files_below(snapshot)};
  std::filesystem::rename(snapshot, job_->part, error);
  if (!error) {
    job_->files.clear();
    job_->snapshot.clear();
  } else if (error != std::errc::cross_device_link) {
    return store_failure_text(job_->part, error);
  }
  return make_room(bytes_below(error ? snapshot : job_->part));
}

std::optional<std::string> Incidents::make_room(std::uint64_t bytes) const {
  std::vector<path> older = incidents_in(folder_);
  std::uint64_t max_bytes = 0;
  {
    const std::scoped_lock lock(mutex_);
    max_bytes = max_bytes_;
  }
  if (bytes > max_bytes)
    return store_failure_text(folder_,
                              fmt::format("it has {} MB, and {} are allowed", bytes / 1'000'000, max_bytes / 1'000'000),
                              "raise record.incidents_bytes, or lower record.keep_s");
  for (;;) {
    std::uint64_t older_bytes = 0;
    for (const path& incident : older)
      older_bytes += bytes_below(incident);
    std::error_code error;
    const std::uint64_t free = std::filesystem::space(folder_, error).available;
    if (error)
      return store_failure_text(folder_, error);
    const std::uint64_t wanted = job_->snapshot.empty() ? bytes : 2 * bytes; // leaves as much free
    if (older_bytes + bytes <= max_bytes && older.size() < kMaxIncidents && free >= wanted)
      return std::nullopt;
    if (older.empty() || free + older_bytes < wanted) // deletes no incident in vain
      return store_failure_text(folder_,
                                fmt::format("{} MB free on the disk, {} needed", free / 1'000'000, wanted / 1'000'000),
                                "free space, or lower record.keep_s");
    std::filesystem::remove_all(older.front(), error);
    if (error)
      return store_failure_text(older.front(), error);
    older.erase(older.begin());
  }
}

/// Copies files from the last to the first, kBytesPerRound per call. Waits for the disk only after a complete file.
std::optional<std::string> Incidents::copy_files() {
  for (std::size_t copied = 0; copied < kBytesPerRound;) {
    if (job_->files.empty())
      return finish();
    const path from = job_->snapshot / job_->files.back(), to = job_->part / job_->files.back();
    if (job_->in.number() < 0) {
      std::error_code ignored;
      std::filesystem::create_directories(to.parent_path(), ignored);
      job_->in = Descriptor{open(from.c_str(), O_RDONLY | O_CLOEXEC)};
      job_->out = Descriptor{open(to.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644)};
    }
    const int in = job_->in.number(), out = job_->out.number();
    const ssize_t sent = in < 0 || out < 0 ? -1 : sendfile(out, in, nullptr, kBytesPerRound);
    if (sent < 0 || (sent == 0 && fdatasync(out) != 0))
      return store_failure_text(to, errno);
    copied += static_cast<std::size_t>(sent);
    if (sent == 0) {
      job_->in = Descriptor{};
      job_->out = Descriptor{};
      job_->files.pop_back();
    }
  }
  return std::nullopt;
}

std::optional<std::string> Incidents::finish() {
  std::ofstream report{job_->part / "why.json"};
  report << job_->request.report << std::flush;
  if (!report)
    return store_failure_text(job_->part / "why.json", errno);
  report.close();
  std::error_code error;
  std::filesystem::rename(job_->part, job_->target, error);
  if (error)
    return store_failure_text(job_->target, error);
  end("");
  return std::nullopt;
}

/// Ends the job, removes the remains of a failed one, and updates the status.
void Incidents::end(const std::string& problem) {
  std::error_code ignored;
  if (job_ && !job_->snapshot.empty())
    std::filesystem::remove_all(job_->snapshot, ignored);
  if (job_ && !problem.empty())
    std::filesystem::remove_all(job_->part, ignored);
  job_.reset();
  const std::scoped_lock lock(mutex_);
  if (problem.empty()) {
    status_.last = status_.writing;
    ++status_.stored;
    status_.problem.clear();
  }
  (is_requested_ ? status_.refusal : status_.problem) = problem;
  status_.writing.clear();
}

path snapshot_in(const path& folder_of_runs) { return folder_of_runs / ".incident.part"; }

std::vector<path> last_pieces(const path& run, Duration keep) {
  std::vector<path> pieces = pieces_in(run);
  if (pieces.empty())
    return {};
  Stamp end = Stamp::min();
  for (const path& piece : pieces)
    end = std::max(end, last_write(piece / "lidar.pcap"));
  std::erase_if(pieces, [&](const path& piece) { return last_write(piece / "lidar.pcap") < end - keep; });
  return pieces;
}

} // namespace locus::daemon
