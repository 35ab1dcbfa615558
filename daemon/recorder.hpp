// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <bitset>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "config/config.hpp"
#include "core/base/stamp.hpp"
#include "core/ingest/sweep.hpp"
#include "daemon/capture_ring.hpp"
#include "daemon/input.hpp"
#include "daemon/piece_writer.hpp"
#include "daemon/threads.hpp"
#include "drivers/velodyne/model.hpp"

namespace locus::daemon {

/// Records the input for locus-replay in a CaptureRing.
///
/// The producer, the ingest thread, copies each input into a ring in memory and never blocks. The disk thread writes
/// them to files; inputs that overflow the ring or that the disk rejects are dropped and counted. After a failure it
/// retries with a new piece every few seconds. A crash loses the input since the last round of that thread, a power cut
/// the last few seconds.
class Recorder {
 public:
  /// Ring capacity, 20 MB: 20 s of a VLP-16, 2 s of an Ouster with 128 beams at low data rate.
  static constexpr std::size_t kMaxUnwritten = 16384;

  struct Status {
    std::filesystem::path run;  ///< current run; empty before the first input
    std::uint64_t bytes = 0;    ///< size of all recordings in the folder
    std::uint64_t recorded = 0; ///< inputs recorded
    std::uint64_t dropped = 0;  ///< inputs lost because the disk was too slow or failed
    std::uint64_t unfit = 0;    ///< samples that the files cannot hold, see PieceWriter
    std::string problem;        ///< current failure; empty if there is none
  };

  /// Prepares a recording; the run begins with the first input.
  Recorder(const std::filesystem::path& folder, Config config, RecordingBounds bounds);

  /// Producer: records datagrams and motion samples, ignores other inputs. Takes no lock, allocates nothing.
  void record(const Input& input) noexcept;

  /// Disk thread, periodically: writes the queued inputs. The last round flushes to the system without waiting for the
  /// disk.
  void write(bool last_round);

  /// Disk thread: writes the queued inputs and ends the current piece. Returns the pieces of this run that hold its
  /// last `keep`.
  std::vector<std::filesystem::path> end_pieces(Duration keep);

  /// Returns the status. Any thread except the producer's.
  [[nodiscard]] Status status() const;

 private:
  /// Part of a datagram. A Velodyne packet fits one part; other datagrams are split into several.
  struct DatagramPart {
    static constexpr std::size_t kMaxBytes = velodyne::kDataPacketBytes + 2;

    Datagram datagram; ///< without payload
    std::size_t bytes = 0;
    bool is_last = true;
    std::array<std::byte, kMaxBytes> payload{};
  };
  using Entry = std::variant<ImuInput, OdometryInput, DatagramPart>;

  [[nodiscard]] bool push(const Datagram& datagram) noexcept;
  void write(const Entry& entry);
  [[nodiscard]] bool write_to_piece(const Entry& entry);
  bool begin_piece(Stamp now);
  void end_piece();
  void flush(bool to_disk);
  void update_status();

  Config config_;
  std::bitset<kMaxSources> has_file_; ///< by source index
  using Queue = SpscRing<Entry, kMaxUnwritten>;
  std::unique_ptr<Queue> queue_ = std::make_unique<Queue>(); ///< on the heap: larger than a stack
  std::atomic<std::uint64_t> overflowed_{0};                 ///< inputs dropped because the ring was full

  CaptureRing disk_;                        ///< this and the following are owned by the disk thread
  Duration piece_duration_, piece_start_{}; ///< longest duration of a piece; start of this one, CLOCK_MONOTONIC
  bool is_started_ = false, is_last_round_ = false;
  std::optional<PieceWriter> piece_;
  std::vector<std::byte> parts_; ///< parts of a datagram received so far
  std::uint64_t unflushed_ = 0;  ///< inputs written to the piece, not yet flushed
  std::uint64_t flushed_ = 0;    ///< inputs flushed to the piece
  std::uint64_t recorded_ = 0, dropped_ = 0, unfit_ = 0;
  std::string problem_;
  Duration retry_at_{}, synced_{}; ///< CLOCK_MONOTONIC

  mutable std::mutex status_mutex_; ///< never locked by the producer
  Status status_;
};

/// Input source that passes a copy of each input to a recorder. One owner.
class RecordingInput : public InputSource {
 public:
  /// Wraps `source`; both arguments must outlive this.
  RecordingInput(InputSource& source, Recorder& recorder) : source_(source), recorder_(recorder) {}

  Input next(Duration timeout) override {
    Input input = source_.next(timeout);
    recorder_.record(input);
    return input;
  }
  void update_filter(const LidarRouter& lidars) override { source_.update_filter(lidars); }

 private:
  InputSource& source_;
  Recorder& recorder_;
};

} // namespace locus::daemon
