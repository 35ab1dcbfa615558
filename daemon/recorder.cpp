// SPDX-License-Identifier: Apache-2.0
#include "daemon/recorder.hpp"

#include <algorithm>
#include <ctime>
#include <type_traits>
#include <utility>

#include <sys/resource.h>

#include "daemon/machine_time.hpp"

namespace locus::daemon {
namespace {

constexpr Duration kRound = std::chrono::milliseconds{100}; ///< between two looks for what is to be written
constexpr Duration kToDiskEvery = std::chrono::seconds{5};
constexpr Duration kTryAgainAfter = std::chrono::seconds{10};

} // namespace

Recorder::Recorder(const std::filesystem::path& folder, Config config)
    : config_(std::move(config)), disk_(folder, config_.record.max_bytes),
      worker_(
          "recorder", kRound, [this] { write_waiting(); }, [this] { begin(); }) {
  const auto files = sample_files(config_);
  for (std::size_t i = 0; i < files.size(); ++i)
    has_file_[i] = files[i].has_value();
}

void Recorder::take(const Input& input) noexcept {
  bool taken = true;
  if (const auto* datagram = std::get_if<Datagram>(&input)) {
    StoredDatagram stored{*datagram, std::min(datagram->payload.size(), StoredDatagram::kMaxBytes)};
    std::copy_n(datagram->payload.begin(), stored.bytes, stored.payload.begin());
    taken = waiting_->push(stored);
  } else if (const auto* imu = std::get_if<ImuInput>(&input); imu != nullptr && has_file_[index_of(imu->source)]) {
    taken = waiting_->push(*imu);
  } else if (const auto* odometry = std::get_if<OdometryInput>(&input)) {
    taken = waiting_->push(*odometry);
  }
  if (!taken)
    overflowed_.fetch_add(1, std::memory_order_relaxed);
}

Recorder::Status Recorder::status() const {
  const std::scoped_lock lock(status_mutex_);
  Status status = status_;
  status.dropped += overflowed_.load(std::memory_order_relaxed);
  return status;
}

void Recorder::begin() {
  constexpr int kLeastPriority = 19;
  setpriority(PRIO_PROCESS, 0, kLeastPriority); // of this thread alone, on Linux
  problem_ = disk_.obstacle().value_or("");     // before anything is lost by it
}

/// Not more than fit the ring: what comes in meanwhile waits for the next round.
void Recorder::write_waiting() {
  for (std::size_t written = 0; written < kMaxUnwritten; ++written) {
    const std::optional<Entry> entry = waiting_->pop();
    if (!entry)
      break;
    write(*entry);
  }
  if (piece_)
    flush(read_clock(CLOCK_MONOTONIC) - synced_ > kToDiskEvery);
  tell();
}

void Recorder::write(const Entry& entry) {
  if (!piece_ && !begin_piece(Stamp{read_clock(CLOCK_REALTIME)})) {
    ++dropped_;
    return;
  }
  const bool written = std::visit(
      [this](const auto& input) {
        if constexpr (std::is_same_v<std::decay_t<decltype(input)>, StoredDatagram>) {
          Datagram datagram = input.datagram;
          datagram.payload = {input.payload.data(), input.bytes};
          piece_->write(datagram);
          return true;
        } else {
          return piece_->write(input);
        }
      },
      entry);
  ++(written ? unflushed_ : unfit_);
  if (piece_->bytes() >= disk_.piece_bytes())
    end_piece();
}

bool Recorder::begin_piece(Stamp now) {
  if (read_clock(CLOCK_MONOTONIC) < try_again_)
    return false;
  const auto fail = [this](const std::string& problem) {
    problem_ = problem;
    try_again_ = read_clock(CLOCK_MONOTONIC) + kTryAgainAfter;
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
  synced_ = read_clock(CLOCK_MONOTONIC);
  return true;
}

void Recorder::end_piece() {
  flush(true);
  if (!piece_)
    return;
  piece_.reset();
  disk_.end_piece();
}

/// A piece that the disk does not take is ended where it is. Who is told to stop does not wait for the disk: the system
/// has it all.
void Recorder::flush(bool to_disk) {
  const bool waits = to_disk && !worker_.stopping();
  const std::optional<std::string> problem = piece_->flush(waits);
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
  try_again_ = read_clock(CLOCK_MONOTONIC) + kTryAgainAfter;
  piece_.reset();
  if (flushed_ > 0)
    disk_.end_piece();
  else
    disk_.discard_piece();
}

void Recorder::tell() {
  const std::scoped_lock lock(status_mutex_);
  status_.run = disk_.run();
  status_.bytes = disk_.bytes() + (piece_ ? piece_->bytes() : 0);
  status_.recorded = recorded_;
  status_.dropped = dropped_;
  status_.unfit = unfit_;
  status_.problem = problem_;
}

} // namespace locus::daemon
