// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <bitset>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <deque>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "config/config.hpp"
#include "core/base/expected.hpp"
#include "core/base/stamp.hpp"
#include "core/ingest/sweep.hpp"
#include "daemon/input.hpp"
#include "daemon/threads.hpp"
#include "drivers/files/pcap_writer.hpp"
#include "drivers/velodyne/model.hpp"

namespace locus::daemon {

/// How much of a recording stays.
struct RecordingBounds {
  std::uint64_t max_bytes;   ///< of the folder
  Duration piece = kForEver; ///< at most, from the first input to the last
  Duration keep = kForEver;  ///< pieces that ended longer ago are removed with the next one

  static constexpr Duration kForEver = std::chrono::hours{24 * 365 * 100};
};

/// Recordings on a disk of which they may have so much: FOLDER/RUN/PIECE, each piece a capture folder.
///
/// A run is named by a number, one more than that of the last, and the time of its first input, e.g.
/// 000003_2026-11-22T08-12-05Z; its pieces are numbered. For a new piece the oldest ones of all runs are removed until
/// it fits below the bound and as much as a piece stays free on the disk. Nothing is touched that is not named so: a
/// run that was moved or renamed is kept. One owner, who may be held up by the disk.
class CaptureRing {
 public:
  /// Looks at the disk with the first piece.
  CaptureRing(std::filesystem::path folder, std::uint64_t max_bytes, Duration keep = RecordingBounds::kForEver);

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
  /// Of the run, in order, those that ended within so much time.
  [[nodiscard]] std::vector<std::filesystem::path> last_pieces(Duration keep) const;
  /// On the disk, without the piece that is begun.
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }
  /// Folder of the run; empty before the first piece.
  [[nodiscard]] const std::filesystem::path& run() const { return run_; }

 private:
  struct Piece {
    std::filesystem::path folder;
    std::uint64_t bytes;
    Duration ended; ///< CLOCK_MONOTONIC; of one that was there before, when it was found
  };

  std::optional<std::string> look();
  std::optional<std::string> make_room();
  Expected<std::filesystem::path, std::string> make_piece(Stamp now);
  std::optional<std::string> remove_oldest();

  std::filesystem::path folder_;
  std::uint64_t max_bytes_;
  Duration keep_;
  bool looked_ = false;
  std::deque<Piece> pieces_; ///< the oldest first
  std::uint64_t bytes_ = 0;  ///< of pieces_
  int last_run_ = 0;
  std::filesystem::path run_, piece_;
  int last_piece_ = 0;
};

/// The file of a capture folder for the samples of each source, by index; none for a second IMU, which the format does
/// not know.
std::vector<std::optional<std::string>> sample_files(const Config& config);

/// Writes a capture folder: lidar.pcap, config.yaml, and for each source its samples with their arrivals. Every number
/// is read again as it was. One owner, who may be held up by the disk.
class PieceWriter {
 public:
  /// Into an empty folder. Fails with one line for the user.
  static Expected<PieceWriter, std::string> open(const std::filesystem::path& folder, const Config& config);

  void write(const Datagram& datagram) { pcap_.write(datagram); }
  /// False where the format cannot hold the sample: its time is before 1951, or its rotation none.
  bool write(const ImuInput& input);
  bool write(const OdometryInput& input);

  /// Hands all over to the system, or to the disk itself. One line for the user unless all has reached it.
  std::optional<std::string> flush(bool to_disk);

  /// Of all files so far.
  [[nodiscard]] std::uint64_t bytes() const { return pcap_.bytes() + text_bytes_; }

 private:
  struct Closer {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  struct TextFile {
    std::filesystem::path path;
    std::unique_ptr<std::FILE, Closer> file{};
  };
  struct SourceFiles {
    TextFile samples, meta; ///< without a path: of a source that is not recorded
  };

  PieceWriter(PcapWriter pcap, const std::filesystem::path& folder, const Config& config);
  bool write(SourceId source, Stamp stamp, Stamp arrival, double covariance_scale, const std::string& line);
  void append(TextFile& file, const std::string& text);

  PcapWriter pcap_;
  TextFile config_;
  std::vector<SourceFiles> sources_; ///< by index; opened with the first sample
  std::uint64_t text_bytes_ = 0;
  std::optional<std::string> problem_; ///< since the piece was begun
};

/// Records what comes in, for locus-replay, in a CaptureRing.
///
/// The producer, the ingest thread, leaves a copy of each input in a ring in memory and is never held up. Another
/// thread takes them to the disk; what does not fit the ring meanwhile, or what the disk does not take, is dropped and
/// counted. After a failure it is tried again with a new piece, every few seconds. A crash costs what came since the
/// last round of that thread, a power cut the last few seconds.
class Recorder {
 public:
  /// 20 MB: twenty seconds of a VLP-16, two of an Ouster with 128 beams at low data rate.
  static constexpr std::size_t kMaxUnwritten = 16384;

  struct Status {
    std::filesystem::path run;  ///< being recorded; empty before the first input
    std::uint64_t bytes = 0;    ///< of all recordings in the folder
    std::uint64_t recorded = 0; ///< inputs
    std::uint64_t dropped = 0;  ///< inputs that the disk was too slow for, or did not take
    std::uint64_t unfit = 0;    ///< samples that the files cannot hold, see PieceWriter
    std::string problem;        ///< why nothing can be recorded; empty while all is well
  };

  /// Begins a run with the first input.
  Recorder(const std::filesystem::path& folder, Config config, RecordingBounds bounds);

  /// Producer: datagrams and motion samples; other inputs are none of a sensor's. Takes no lock, allocates nothing.
  void take(const Input& input) noexcept;

  /// Thread of the disk, again and again: writes what was taken. In the last round it does not wait until the disk has
  /// it: the system has it all.
  void write(bool last_round);

  /// Thread of the disk: writes what was taken and ends the piece, whatever it has. The pieces of this run that hold
  /// the last so much of it.
  std::vector<std::filesystem::path> end_pieces(Duration keep);

  /// Any thread but the producer's.
  [[nodiscard]] Status status() const;

 private:
  /// One of a Velodyne is whole; the packets of other lidars, and what is no lidar's, come in several parts.
  struct DatagramPart {
    static constexpr std::size_t kMaxBytes = velodyne::kDataPacketBytes + 2;

    Datagram datagram; ///< without payload
    std::size_t bytes = 0;
    bool is_last = true;
    std::array<std::byte, kMaxBytes> payload{};
  };
  using Entry = std::variant<ImuInput, OdometryInput, DatagramPart>;

  [[nodiscard]] bool store(const Datagram& datagram) noexcept;
  void write(const Entry& entry);
  [[nodiscard]] bool write_to_piece(const Entry& entry);
  bool begin_piece(Stamp now);
  void end_piece();
  void flush(bool to_disk);
  void tell();

  Config config_;
  std::bitset<kMaxSources> has_file_; ///< by the index of the source
  using Waiting = SpscRing<Entry, kMaxUnwritten>;
  std::unique_ptr<Waiting> waiting_ = std::make_unique<Waiting>(); ///< larger than a stack
  std::atomic<std::uint64_t> overflowed_{0};                       ///< inputs that the ring in memory had no room for

  CaptureRing disk_;                   ///< this and the next are of the thread of the disk
  Duration piece_for_, piece_began_{}; ///< at most; CLOCK_MONOTONIC
  bool has_begun_ = false, is_last_round_ = false;
  std::optional<PieceWriter> piece_;
  std::vector<std::byte> parts_; ///< of a datagram, before its last one
  std::uint64_t unflushed_ = 0;  ///< inputs that the piece may still lose
  std::uint64_t flushed_ = 0;    ///< inputs in the piece
  std::uint64_t recorded_ = 0, dropped_ = 0, unfit_ = 0;
  std::string problem_;
  Duration try_again_{}, synced_{}; ///< CLOCK_MONOTONIC

  mutable std::mutex status_mutex_; ///< never taken by the producer
  Status status_;
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
