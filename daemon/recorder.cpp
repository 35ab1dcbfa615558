// SPDX-License-Identifier: Apache-2.0
#include "daemon/recorder.hpp"

#include <algorithm>
#include <cerrno>
#include <ctime>
#include <system_error>
#include <type_traits>
#include <utility>

#include <fcntl.h>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <unistd.h>

#include "config/config_yaml.hpp"
#include "daemon/machine_time.hpp"
#include "drivers/files/capture_folder.hpp"
#include "drivers/files/motion_files.hpp"

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

std::string disk_failure_text(const char* what, const path& file, const std::error_code& error) {
  return fmt::format("{}: {} ({}); let locusd write there, see RECORDING and INCIDENTS in locusd(8)", file.string(),
                     what, error.message());
}

} // namespace

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

namespace {

/// File buffer: holds the samples of one round of the recorder, so that they are written at once.
constexpr std::size_t kBufferBytes = 1 << 16;

bool is_storable(Stamp stamp) { return stamp > kEarliestStamp && stamp < kLatestStamp; }

std::string write_failure_text(const std::filesystem::path& file) {
  return fmt::format("{}: cannot be written ({}); check permissions and free space", file.string(),
                     std::generic_category().message(errno));
}

/// Copies the metadata without which an Ouster's packets cannot be decoded; skipped if the original no longer exists.
std::optional<std::string> copy_metadata(const LidarOptions& lidar, const path& folder) {
  std::error_code error;
  if (!lidar.is_ouster() || !std::filesystem::exists(lidar.metadata, error))
    return std::nullopt;
  const path copy = folder / metadata_file(lidar.name);
  std::filesystem::copy_file(lidar.metadata, copy, std::filesystem::copy_options::overwrite_existing, error);
  return error ? std::optional{disk_failure_text("cannot be written", copy, error)} : std::nullopt;
}

} // namespace

std::vector<std::optional<std::string>> sample_files(const Config& config) {
  std::vector<std::optional<std::string>> files;
  bool has_imu = false;
  for (const MotionSource& source : config.motion_sources) {
    const bool is_reserved_name = source.kind == SourceKind::odometry && (source.name == "gt" || source.name == "imu");
    if (is_reserved_name || source.of_lidar) // samples in a lidar's packets are recorded with them
      files.emplace_back(std::nullopt);
    else if (source.kind == SourceKind::odometry)
      files.emplace_back(source.name + ".tum");
    else
      files.push_back(std::exchange(has_imu, true) ? std::nullopt : std::optional<std::string>{"imu.csv"});
  }
  return files;
}

Expected<PieceWriter, std::string> PieceWriter::open(const std::filesystem::path& folder, const Config& config) {
  auto pcap = PcapWriter::open(folder / "lidar.pcap");
  if (!pcap)
    return pcap.error();
  PieceWriter writer(std::move(*pcap), folder, config);
  writer.append(writer.config_, print_config(config));
  for (const LidarOptions& lidar : config.lidars)
    if (auto problem = copy_metadata(lidar, folder))
      return *problem;
  if (auto problem = writer.flush(false))
    return *problem;
  return writer;
}

PieceWriter::PieceWriter(PcapWriter pcap, const std::filesystem::path& folder, const Config& config)
    : pcap_(std::move(pcap)), config_{folder / "config.yaml"} {
  for (const std::optional<std::string>& file : sample_files(config)) {
    SourceFiles& source = sources_.emplace_back();
    if (file) {
      source.samples.path = source.meta.path = folder / *file;
      source.meta.path.replace_extension(".meta.csv");
    }
  }
}

bool PieceWriter::write(const ImuInput& input) {
  return write(input.source, input.sample.stamp, input.sample.arrival, 1.0, to_line(input.sample));
}

bool PieceWriter::write(const OdometryInput& input) {
  const OdometrySample& sample = input.sample;
  return sample.T_source_base.rotation.norm() != 0.0 &&
         write(input.source, sample.stamp, sample.arrival, sample.covariance_scale,
               to_line({sample.stamp, sample.T_source_base}));
}

bool PieceWriter::write(SourceId source, Stamp stamp, Stamp arrival, double covariance_scale, const std::string& line) {
  SourceFiles& files = sources_[index_of(source)];
  if (files.samples.path.empty() || !is_storable(stamp) || !is_storable(arrival))
    return false;
  append(files.samples, line);
  append(files.meta, fmt::format("{},{},{}\n", to_ns(stamp), to_ns(arrival), covariance_scale));
  return true;
}

void PieceWriter::append(TextFile& file, const std::string& text) {
  if (!file.file && !problem_) {
    file.file.reset(std::fopen(file.path.c_str(), "we"));
    if (file.file)
      std::setvbuf(file.file.get(), nullptr, _IOFBF, kBufferBytes);
    else
      problem_ = write_failure_text(file.path);
  }
  if (file.file && std::fwrite(text.data(), 1, text.size(), file.file.get()) != text.size() && !problem_)
    problem_ = write_failure_text(file.path);
  text_bytes_ += text.size();
}

/// Flushes the samples before their meta rows, so that a crash in between loses only rows.
std::optional<std::string> PieceWriter::flush(bool to_disk) {
  const auto flush_text = [&](TextFile& file) {
    if (file.file && !problem_ &&
        (std::fflush(file.file.get()) != 0 || (to_disk && fdatasync(fileno(file.file.get())) != 0)))
      problem_ = write_failure_text(file.path);
  };
  if (!problem_)
    problem_ = pcap_.flush();
  if (to_disk && !problem_ && fdatasync(pcap_.descriptor()) != 0)
    problem_ = write_failure_text(config_.path.parent_path() / "lidar.pcap");
  flush_text(config_);
  for (SourceFiles& source : sources_) {
    flush_text(source.samples);
    flush_text(source.meta);
  }
  return problem_;
}

namespace {

constexpr Duration kSyncPeriod = std::chrono::seconds{5};
constexpr Duration kRetryDelay = std::chrono::seconds{10};

} // namespace

Recorder::Recorder(const std::filesystem::path& folder, Config config, RecordingBounds bounds)
    : config_(std::move(config)), disk_(folder, bounds.max_bytes, bounds.keep), piece_duration_(bounds.piece) {
  const auto files = sample_files(config_);
  for (std::size_t i = 0; i < files.size(); ++i)
    has_file_[i] = files[i].has_value();
}

void Recorder::record(const Input& input) noexcept {
  bool queued = true;
  if (const auto* datagram = std::get_if<Datagram>(&input)) {
    queued = push(*datagram);
  } else if (const auto* imu = std::get_if<ImuInput>(&input); imu != nullptr && has_file_[index_of(imu->source)]) {
    queued = queue_->push(*imu);
  } else if (const auto* odometry = std::get_if<OdometryInput>(&input);
             odometry != nullptr && has_file_[index_of(odometry->source)]) {
    queued = queue_->push(*odometry);
  }
  if (!queued)
    overflowed_.fetch_add(1, std::memory_order_relaxed);
}

/// Queues all parts of a datagram, or none.
bool Recorder::push(const Datagram& datagram) noexcept {
  constexpr std::size_t kPartBytes = DatagramPart::kMaxBytes;
  std::span<const std::byte> rest = datagram.payload;
  if (queue_->free_slots() < std::max<std::size_t>(1, (rest.size() + kPartBytes - 1) / kPartBytes))
    return false;
  do {
    DatagramPart part{datagram, std::min(rest.size(), kPartBytes), rest.size() <= kPartBytes};
    std::copy_n(rest.begin(), part.bytes, part.payload.begin());
    rest = rest.subspan(part.bytes);
    if (!queue_->push(part))
      return false;
  } while (!rest.empty());
  return true;
}

Recorder::Status Recorder::status() const {
  const std::scoped_lock lock(status_mutex_);
  Status status = status_;
  status.dropped += overflowed_.load(std::memory_order_relaxed);
  return status;
}

/// Writes at most one ring capacity of inputs; later ones wait for the next round.
void Recorder::write(bool last_round) {
  is_last_round_ = last_round;
  if (!std::exchange(is_started_, true))
    problem_ = disk_.obstacle().value_or(""); // reported before an input is lost
  for (std::size_t written = 0; written < kMaxUnwritten; ++written) {
    const std::optional<Entry> entry = queue_->pop();
    if (!entry)
      break;
    write(*entry);
  }
  if (piece_)
    flush(read_clock(CLOCK_MONOTONIC) - synced_ > kSyncPeriod);
  update_status();
}

/// Writes an entry; parts of a datagram are collected until its last one.
void Recorder::write(const Entry& entry) {
  if (const auto* part = std::get_if<DatagramPart>(&entry)) {
    parts_.insert(parts_.end(), part->payload.begin(),
                  part->payload.begin() + static_cast<std::ptrdiff_t>(part->bytes));
    if (!part->is_last)
      return;
  }
  if (!piece_ && !begin_piece(Stamp{read_clock(CLOCK_REALTIME)})) {
    ++dropped_;
    parts_.clear();
    return;
  }
  ++(write_to_piece(entry) ? unflushed_ : unfit_);
  if (piece_->bytes() >= disk_.piece_bytes() || read_clock(CLOCK_MONOTONIC) - piece_start_ >= piece_duration_)
    end_piece();
}

bool Recorder::write_to_piece(const Entry& entry) {
  if (const auto* imu = std::get_if<ImuInput>(&entry))
    return piece_->write(*imu);
  if (const auto* odometry = std::get_if<OdometryInput>(&entry))
    return piece_->write(*odometry);
  Datagram datagram = std::get<DatagramPart>(entry).datagram;
  datagram.payload = parts_;
  piece_->write(datagram);
  parts_.clear();
  return true;
}

std::vector<std::filesystem::path> Recorder::end_pieces(Duration keep) {
  write(false);
  if (piece_)
    end_piece();
  return disk_.last_pieces(keep);
}

bool Recorder::begin_piece(Stamp now) {
  if (read_clock(CLOCK_MONOTONIC) < retry_at_)
    return false;
  const auto fail = [this](const std::string& problem) {
    problem_ = problem;
    retry_at_ = read_clock(CLOCK_MONOTONIC) + kRetryDelay;
    return false;
  };
  const auto folder = disk_.begin_piece(now);
  if (!folder)
    return fail(folder.error());
  auto piece = PieceWriter::open(*folder, config_);
  if (!piece) {
    disk_.discard_piece();
    return fail(piece.error());
  }
  piece_.emplace(std::move(*piece));
  flushed_ = 0;
  piece_start_ = synced_ = read_clock(CLOCK_MONOTONIC);
  return true;
}

void Recorder::end_piece() {
  flush(true);
  if (!piece_)
    return;
  piece_.reset();
  disk_.end_piece();
}

/// Flushes the piece; on failure ends it with the data flushed so far.
void Recorder::flush(bool to_disk) {
  const std::optional<std::string> problem = piece_->flush(to_disk && !is_last_round_);
  const std::uint64_t inputs = std::exchange(unflushed_, 0);
  problem_ = problem.value_or("");
  if (to_disk)
    synced_ = read_clock(CLOCK_MONOTONIC);
  if (!problem) {
    recorded_ += inputs;
    flushed_ += inputs;
    return;
  }
  dropped_ += inputs;
  retry_at_ = read_clock(CLOCK_MONOTONIC) + kRetryDelay;
  piece_.reset();
  if (flushed_ > 0)
    disk_.end_piece();
  else
    disk_.discard_piece();
}

void Recorder::update_status() {
  const std::scoped_lock lock(status_mutex_);
  status_.run = disk_.run();
  status_.bytes = disk_.bytes() + (piece_ ? piece_->bytes() : 0);
  status_.recorded = recorded_;
  status_.dropped = dropped_;
  status_.unfit = unfit_;
  status_.problem = problem_;
}

} // namespace locus::daemon
