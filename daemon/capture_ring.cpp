// SPDX-License-Identifier: Apache-2.0
#include "daemon/capture_ring.hpp"

#include <cerrno>
#include <ctime>
#include <utility>

#include <fcntl.h>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <unistd.h>

#include "daemon/machine_time.hpp"
#include "drivers/files/capture_folder.hpp"

namespace locus::daemon {

namespace {

using std::filesystem::path;

constexpr std::uint64_t kPieces = 16; ///< full-size pieces per folder
constexpr std::uint64_t kBlockBytes = 4096;
constexpr std::uint64_t kBlocksOfPiece = 32; ///< overhead of a piece: its folder and partly filled blocks

std::uint64_t bytes_on_disk(const path& folder) {
  std::uint64_t blocks = 1;
  std::error_code error;
  for (std::filesystem::directory_iterator entry{folder, error}, end; !error && entry != end; entry.increment(error)) {
    std::error_code vanished;
    const std::uintmax_t bytes = entry->file_size(vanished);
    blocks += vanished ? 1 : (bytes + kBlockBytes - 1) / kBlockBytes;
  }
  return blocks * kBlockBytes;
}

} // namespace

std::string disk_failure_text(const char* what, const path& file, const std::error_code& error) {
  return fmt::format("{}: {} ({}); let locusd write there, see RECORDING and INCIDENTS in locusd(8)", file.string(),
                     what, error.message());
}

CaptureRing::CaptureRing(path folder, std::uint64_t max_bytes, Duration keep)
    : folder_(std::move(folder)), max_bytes_(max_bytes), keep_(keep) {}

std::uint64_t CaptureRing::piece_bytes() const { return max_bytes_ / kPieces - kBlocksOfPiece * kBlockBytes; }

std::optional<std::string> CaptureRing::obstacle() const {
  std::error_code error;
  path existing = std::filesystem::absolute(folder_, error);
  while (!std::filesystem::exists(existing, error) && existing.has_relative_path())
    existing = existing.parent_path();
  if (!std::filesystem::is_directory(existing, error))
    return disk_failure_text("cannot be created", folder_, std::make_error_code(std::errc::not_a_directory));
  if (faccessat(AT_FDCWD, existing.c_str(), W_OK, AT_EACCESS) != 0)
    return disk_failure_text("cannot be written to", existing, {errno, std::generic_category()});
  return std::nullopt;
}

/// Lists the pieces on the disk.
std::optional<std::string> CaptureRing::scan_folder() {
  pieces_.clear();
  bytes_ = 0;
  std::error_code error;
  std::filesystem::create_directories(folder_, error);
  if (error)
    return disk_failure_text("cannot be created", folder_, error);
  for (const path& run : runs_in(folder_)) {
    last_run_ = number_of(run);
    for (const path& piece : pieces_in(run)) {
      pieces_.push_back({piece, bytes_on_disk(piece), read_clock(CLOCK_MONOTONIC)});
      bytes_ += pieces_.back().bytes;
    }
  }
  is_scanned_ = true;
  return std::nullopt;
}

std::optional<std::string> CaptureRing::make_room() {
  const std::uint64_t piece = max_bytes_ / kPieces;
  while (!pieces_.empty() && pieces_.front().ended < read_clock(CLOCK_MONOTONIC) - keep_)
    if (auto problem = remove_oldest())
      return problem;
  for (;;) {
    std::error_code error;
    const std::uint64_t free = std::filesystem::space(folder_, error).available;
    if (error)
      return disk_failure_text("cannot be read", folder_, error);
    if (bytes_ + piece <= max_bytes_ && free >= 2 * piece)
      return std::nullopt;
    if (free + bytes_ < 2 * piece)
      return fmt::format("{}: {} MB free on the disk, {} needed; free space, or lower its limit in record",
                         folder_.string(), free / 1'000'000, 2 * piece / 1'000'000);
    if (auto problem = remove_oldest())
      return problem;
  }
}

std::optional<std::string> CaptureRing::remove_oldest() {
  const Piece oldest = pieces_.front();
  std::error_code error;
  std::filesystem::remove_all(oldest.folder, error);
  if (error)
    return disk_failure_text("cannot be removed", oldest.folder, error);
  std::filesystem::remove(oldest.folder.parent_path(), error); // fails unless the run is empty
  bytes_ -= oldest.bytes;
  pieces_.pop_front();
  return std::nullopt;
}

/// Rereads the disk after a failure, since the folder may have been removed.
Expected<path, std::string> CaptureRing::begin_piece(Stamp now) {
  if (auto problem = is_scanned_ ? std::nullopt : scan_folder())
    return *problem;
  auto piece = make_piece(now);
  is_scanned_ = piece.has_value();
  return piece;
}

Expected<path, std::string> CaptureRing::make_piece(Stamp now) {
  if (auto problem = make_room())
    return *problem;
  if (run_.empty()) {
    const auto seconds = std::chrono::floor<std::chrono::seconds>(now.time_since_epoch());
    run_ = folder_ / fmt::format("{:06}_{:%Y-%m-%dT%H-%M-%SZ}", last_run_ + 1,
                                 fmt::gmtime(static_cast<std::time_t>(seconds.count())));
  }
  piece_ = run_ / fmt::format("{:06}", ++last_piece_);
  std::error_code error;
  const bool is_new = std::filesystem::create_directories(piece_, error);
  if (error)
    return disk_failure_text("cannot be created", piece_, error);
  if (!is_new)
    return fmt::format("{}: exists already; configure separate folders for each locusd", piece_.string());
  return piece_;
}

std::vector<path> CaptureRing::last_pieces(Duration keep) const {
  std::vector<path> last;
  for (const Piece& piece : pieces_)
    if (piece.folder.parent_path() == run_ && piece.ended >= read_clock(CLOCK_MONOTONIC) - keep)
      last.push_back(piece.folder);
  return last;
}

void CaptureRing::end_piece() {
  pieces_.push_back({piece_, bytes_on_disk(piece_), read_clock(CLOCK_MONOTONIC)});
  bytes_ += pieces_.back().bytes;
}

void CaptureRing::discard_piece() {
  std::error_code ignored;
  std::filesystem::remove_all(piece_, ignored);
  std::filesystem::remove(run_, ignored);
}

} // namespace locus::daemon
