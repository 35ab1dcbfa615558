// SPDX-License-Identifier: Apache-2.0
#include "daemon/recorder.hpp"

#include <algorithm>
#include <utility>

#include "daemon/machine_time.hpp"

namespace locus::daemon {

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
