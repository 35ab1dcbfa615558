// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "core/base/expected.hpp"
#include "core/base/stamp.hpp"

namespace locus::daemon {

/// Limits of a recording.
struct RecordingBounds {
  std::uint64_t max_bytes;   ///< size of the folder
  Duration piece = kForEver; ///< longest duration of a piece, first to last input
  Duration keep = kForEver;  ///< age beyond which ended pieces are removed, at the start of the next one

  static constexpr Duration kForEver = std::chrono::hours{24 * 365 * 100};
};

/// Recordings on disk within a size limit: FOLDER/RUN/PIECE, each piece a capture folder.
///
/// A run is named by its consecutive number and the time of its first input, e.g. 000003_2026-11-22T08-12-05Z; its
/// pieces are numbered. Before a new piece the oldest pieces of all runs are removed until it fits the limit and leaves
/// the size of a piece free on the disk. Entries with other names are never touched, so a moved or renamed run is safe.
/// One owner; calls may block on the disk.
class CaptureRing {
 public:
  /// Accesses the disk with the first piece only.
  CaptureRing(std::filesystem::path folder, std::uint64_t max_bytes, Duration keep = RecordingBounds::kForEver);

  /// Returns a certain obstacle to a piece, in one line for the user. Creates nothing.
  [[nodiscard]] std::optional<std::string> obstacle() const;
  /// Makes room, and a folder for the next piece. Fails with one line for the user.
  Expected<std::filesystem::path, std::string> begin_piece(Stamp now);
  /// Adds the current piece to the run as complete.
  void end_piece();
  /// Removes the current piece, which holds no usable data.
  void discard_piece();

  /// Returns the size limit of a piece, all files together.
  [[nodiscard]] std::uint64_t piece_bytes() const;
  /// Returns, in order, the pieces of the run that ended within the last `keep`.
  [[nodiscard]] std::vector<std::filesystem::path> last_pieces(Duration keep) const;
  /// Returns the size on disk without the current piece.
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }
  /// Returns the folder of the run; empty before the first piece.
  [[nodiscard]] const std::filesystem::path& run() const { return run_; }

 private:
  struct Piece {
    std::filesystem::path folder;
    std::uint64_t bytes;
    Duration ended; ///< CLOCK_MONOTONIC; time of discovery for a piece of an earlier run
  };

  std::optional<std::string> scan_folder();
  std::optional<std::string> make_room();
  Expected<std::filesystem::path, std::string> make_piece(Stamp now);
  std::optional<std::string> remove_oldest();

  std::filesystem::path folder_;
  std::uint64_t max_bytes_;
  Duration keep_;
  bool is_scanned_ = false;
  std::deque<Piece> pieces_; ///< oldest first
  std::uint64_t bytes_ = 0;  ///< total size of pieces_
  int last_run_ = 0;
  std::filesystem::path run_, piece_;
  int last_piece_ = 0;
};

/// Describes a failure of the disk at a file or folder of a recording, with the remedy, in one line for the user.
/// `what` failed: for example "cannot be created".
std::string disk_failure_text(const char* what, const std::filesystem::path& file, const std::error_code& error);

} // namespace locus::daemon
