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

/// Returns the name of the sample file of each source in a capture folder, by index; empty for a second IMU, which the
/// format does not support, and for other sources that are not recorded.
std::vector<std::optional<std::string>> sample_files(const Config& config);

/// Writes a capture folder: lidar.pcap, config.yaml, and the samples of each source with their arrivals. Numbers
/// round-trip exactly. One owner; calls may block on the disk.
class PieceWriter {
 public:
  /// Opens the files in an empty folder. Fails with one line for the user.
  static Expected<PieceWriter, std::string> open(const std::filesystem::path& folder, const Config& config);

  void write(const Datagram& datagram) { pcap_.write(datagram); }
  /// Writes a sample; false if the format cannot hold it: a time before 1951, or a zero quaternion.
  bool write(const ImuInput& input);
  bool write(const OdometryInput& input);

  /// Flushes all files to the system, or to the disk. Returns one line for the user on failure.
  std::optional<std::string> flush(bool to_disk);

  /// Returns the size of all files so far.
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
    TextFile samples, meta; ///< empty path: source is not recorded
  };

  PieceWriter(PcapWriter pcap, const std::filesystem::path& folder, const Config& config);
  bool write(SourceId source, Stamp stamp, Stamp arrival, double covariance_scale, const std::string& line);
  void append(TextFile& file, const std::string& text);

  PcapWriter pcap_;
  TextFile config_;
  std::vector<SourceFiles> sources_; ///< by source index; opened with the first sample
  std::uint64_t text_bytes_ = 0;
  std::optional<std::string> problem_; ///< first failure of this piece
};

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
