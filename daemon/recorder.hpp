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

#include "config/config.hpp"
#include "core/ingest/sweep.hpp"
#include "daemon/capture_ring.hpp"
#include "daemon/input.hpp"
#include "daemon/piece_writer.hpp"
#include "daemon/spsc_ring.hpp"
#include "daemon/worker.hpp"
#include "drivers/velodyne/model.hpp"

namespace locus::daemon {

/// Records what comes in, for locus-replay, in a CaptureRing.
///
/// The producer, the ingest thread, leaves a copy of each input in a ring in memory and is never held up. A thread of
/// the least priority takes them to the disk; what does not fit the ring meanwhile, or what the disk does not take, is
/// dropped and counted. After a failure it is tried again with a new piece, every few seconds. A crash costs the last
/// tenth of a second, a power cut the last few seconds.
class Recorder {
 public:
  /// 20 MB: twenty seconds of a VLP-16.
  static constexpr std::size_t kMaxUnwritten = 16384;

  struct Status {
    std::filesystem::path run;  ///< being recorded; empty before the first input
    std::uint64_t bytes = 0;    ///< of all recordings in the folder
    std::uint64_t recorded = 0; ///< inputs
    std::uint64_t dropped = 0;  ///< inputs that the disk was too slow for, or did not take
    std::uint64_t unfit = 0;    ///< samples that the files cannot hold, see PieceWriter
    std::string problem;        ///< why nothing can be recorded; empty while all is well
  };

  /// Begins a run with the first input. When it is destroyed, it first writes what it has taken.
  Recorder(const std::filesystem::path& folder, Config config);

  /// Producer: datagrams and motion samples; other inputs are none of a sensor's. Takes no lock, allocates nothing.
  void take(const Input& input) noexcept;

  /// Any thread but the producer's.
  [[nodiscard]] Status status() const;

 private:
  /// Of a longer one, which is no packet of a lidar, so much is kept that this can still be told.
  struct StoredDatagram {
    static constexpr std::size_t kMaxBytes = velodyne::kDataPacketBytes + 2;

    Datagram datagram; ///< without payload
    std::size_t bytes = 0;
    std::array<std::byte, kMaxBytes> payload{};
  };
  using Entry = std::variant<ImuInput, OdometryInput, StoredDatagram>;

  void begin();
  void write_waiting();
  void write(const Entry& entry);
  bool begin_piece(Stamp now);
  void end_piece();
  void flush(bool to_disk);
  void tell();

  Config config_;
  std::bitset<kMaxSources> has_file_; ///< by the index of the source
  using Waiting = SpscRing<Entry, kMaxUnwritten>;
  std::unique_ptr<Waiting> waiting_ = std::make_unique<Waiting>(); ///< larger than a stack
  std::atomic<std::uint64_t> overflowed_{0};                       ///< inputs that the ring in memory had no room for

  CaptureRing disk_; ///< this and the next are of the thread
  std::optional<PieceWriter> piece_;
  std::uint64_t unflushed_ = 0; ///< inputs that the piece may still lose
  std::uint64_t flushed_ = 0;   ///< inputs in the piece
  std::uint64_t recorded_ = 0, dropped_ = 0, unfit_ = 0;
  std::string problem_;
  Duration try_again_{}, synced_{}; ///< CLOCK_MONOTONIC

  mutable std::mutex status_mutex_; ///< never taken by the producer
  Status status_;
  Worker worker_;
};

/// Inputs on their way to the ingest, a copy of each left with a recorder. One owner.
class RecordingInput : public InputSource {
 public:
  /// Both must outlive this.
  RecordingInput(InputSource& source, Recorder& recorder) : source_(source), recorder_(recorder) {}

  Input next(Duration timeout) override {
    Input input = source_.next(timeout);
    recorder_.take(input);
    return input;
  }
  void expect(const LidarRouter& lidars) override { source_.expect(lidars); }

 private:
  InputSource& source_;
  Recorder& recorder_;
};

} // namespace locus::daemon
