// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <filesystem>
#include <optional>
#include <string>

#include "core/base/expected.hpp"
#include "core/base/stamp.hpp"

namespace locus::daemon {

/// Recordings on a disk of which they may have so much: FOLDER/RUN/PIECE, each piece a capture folder.
///
/// A run is named by a number, one more than that of the last, and the time of its first input, e.g.
/// 000003_2026-11-22T08-12-05Z; its pieces are numbered. For a new piece the oldest ones of all runs are removed until
/// it fits below the bound and as much as a piece stays free on the disk. Nothing is touched that is not named so: a
/// run that was moved or renamed is kept. One owner, who may be held up by the disk.
class CaptureRing {
 public:
  /// Looks at the disk with the first piece.
  CaptureRing(std::filesystem::path folder, std::uint64_t max_bytes);

  /// What is sure to stand in the way of a piece, in one line for the user. Makes nothing.
  [[nodiscard]] std::optional<std::string> obstacle() const;
  /// Makes room, and a folder for the next piece. Fails with one line for the user.
  Expected<std::filesystem::path, std::string> begin_piece(Stamp now);
  /// It is complete.
  void end_piece();
  /// It holds nothing of use.
  void discard_piece();

  /// What the files of a piece may hold together.
  [[nodiscard]] std::uint64_t piece_bytes() const;
  /// On the disk, without the piece that is begun.
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }
  /// Folder of the run; empty before the first piece.
  [[nodiscard]] const std::filesystem::path& run() const { return run_; }

 private:
  struct Piece {
    std::filesystem::path folder;
    std::uint64_t bytes;
  };

  std::optional<std::string> look();
  std::optional<std::string> make_room();
  Expected<std::filesystem::path, std::string> make_piece(Stamp now);
  std::optional<std::string> remove_oldest();

  std::filesystem::path folder_;
  std::uint64_t max_bytes_;
  bool looked_ = false;
  std::deque<Piece> pieces_; ///< the oldest first
  std::uint64_t bytes_ = 0;  ///< of pieces_
  int last_run_ = 0;
  std::filesystem::path run_, piece_;
  int last_piece_ = 0;
};

} // namespace locus::daemon
