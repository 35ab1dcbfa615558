// SPDX-License-Identifier: Apache-2.0
#include "daemon/capture_ring.hpp"

#include <cerrno>
#include <ctime>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <unistd.h>

#include "drivers/files/capture_folder.hpp"

namespace locus::daemon {
namespace {

using std::filesystem::path;

constexpr std::uint64_t kPieces = 16; ///< of the size of one that fill the folder
constexpr std::uint64_t kBlockBytes = 4096;
constexpr std::uint64_t kBlocksOfPiece = 32; ///< that its folder and the ends of its files take

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

std::string cannot(const char* what, const path& where, const std::error_code& error) {
  return fmt::format("{}: {} ({}); let locusd write there, see record.folder in locusd.yaml(5)", where.string(), what,
                     error.message());
}

} // namespace

CaptureRing::CaptureRing(path folder, std::uint64_t max_bytes) : folder_(std::move(folder)), max_bytes_(max_bytes) {}

std::uint64_t CaptureRing::piece_bytes() const { return max_bytes_ / kPieces - kBlocksOfPiece * kBlockBytes; }

std::optional<std::string> CaptureRing::obstacle() const {
  std::error_code error;
  path there = std::filesystem::absolute(folder_, error);
  while (!std::filesystem::exists(there, error) && there.has_relative_path())
    there = there.parent_path();
  if (!std::filesystem::is_directory(there, error))
    return cannot("cannot be made", folder_, std::make_error_code(std::errc::not_a_directory));
  if (faccessat(AT_FDCWD, there.c_str(), W_OK, AT_EACCESS) != 0)
    return cannot("cannot be written to", there, {errno, std::generic_category()});
  return std::nullopt;
}

/// What is there by now.
std::optional<std::string> CaptureRing::look() {
  pieces_.clear();
  bytes_ = 0;
  std::error_code error;
  std::filesystem::create_directories(folder_, error);
  if (error)
    return cannot("cannot be made", folder_, error);
  for (const path& run : runs_in(folder_)) {
    last_run_ = number_of(run);
    for (const path& piece : pieces_in(run)) {
      pieces_.push_back({piece, bytes_on_disk(piece)});
      bytes_ += pieces_.back().bytes;
    }
  }
  looked_ = true;
  return std::nullopt;
}

std::optional<std::string> CaptureRing::make_room() {
  const std::uint64_t piece = max_bytes_ / kPieces;
  for (;;) {
    std::error_code error;
    const std::uint64_t free = std::filesystem::space(folder_, error).available;
    if (error)
      return cannot("cannot be looked at", folder_, error);
    if (bytes_ + piece <= max_bytes_ && free >= 2 * piece)
      return std::nullopt;
    if (free + bytes_ < 2 * piece)
      return fmt::format("{}: {} MB free on the disk, and {} are wanted; free some, or lower record.max_bytes",
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
    return cannot("cannot be removed", oldest.folder, error);
  std::filesystem::remove(oldest.folder.parent_path(), error); // if it was the last of its run
  bytes_ -= oldest.bytes;
  pieces_.pop_front();
  return std::nullopt;
}

/// After a failure the disk is looked at again: somebody may have removed the folder.
Expected<path, std::string> CaptureRing::begin_piece(Stamp now) {
  if (auto problem = looked_ ? std::nullopt : look())
    return *problem;
  auto piece = make_piece(now);
  looked_ = piece.has_value();
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
    return cannot("cannot be made", piece_, error);
  if (!is_new)
    return fmt::format("{}: is there already; give each locusd a record.folder of its own", piece_.string());
  return piece_;
}

void CaptureRing::end_piece() {
  pieces_.push_back({piece_, bytes_on_disk(piece_)});
  bytes_ += pieces_.back().bytes;
}

void CaptureRing::discard_piece() {
  std::error_code ignored;
  std::filesystem::remove_all(piece_, ignored);
  std::filesystem::remove(run_, ignored);
}

} // namespace locus::daemon
