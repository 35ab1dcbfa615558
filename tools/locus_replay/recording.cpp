// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/recording.hpp"

#include <algorithm>
#include <type_traits>
#include <utility>

#include <fmt/format.h>

#include "core/sources/motion_sources.hpp"
#include "drivers/velodyne/model.hpp"
#include "locus_replay/failure.hpp"
#include "locus_replay/recorded_times.hpp"
#include "locus_replay/time_span_text.hpp"

namespace locus::tools {

namespace {

/// Lead of the motion played before the first datagram, so that sources are live when it arrives.
constexpr Duration kMotionAhead = std::chrono::seconds{1};

/// Longest transit of a sample whose stamp and arrival are of one clock.
constexpr Duration kLongestTransit = std::chrono::seconds{10};

/// Sorts samples whose arrivals go back, unless their clock was set: then the first is as old as the capture.
template <class Sample> MotionSamples<Sample> in_order(MotionSamples<Sample> samples, Stamp capture_start) {
  constexpr Duration kLongestWait = std::chrono::seconds{5}; ///< for the first sample of a sensor
  constexpr std::size_t kMostSteps = 10;
  if (samples.steps_back() == 0 ||
      (samples.steps_back() <= kMostSteps && samples.front()->arrival <= capture_start + kLongestWait))
    return samples;
  std::vector<Sample> sorted = samples.drain();
  std::ranges::stable_sort(sorted, {}, &Sample::arrival);
  return MotionSamples<Sample>(std::move(sorted));
}

template <class Sample>
MotionSamples<Sample> with_faults(std::vector<Sample> samples, const PlayOptions& options, const std::string& source,
                                  Stamp capture_start) {
  std::ranges::stable_sort(samples, {}, &Sample::arrival);
  inject_faults(options.faults, source, capture_start, options.seed, samples);
  return MotionSamples<Sample>(std::move(samples));
}

} // namespace

using daemon::EndOfInput;
using daemon::Input;
using daemon::Silence;

void check_faults(const std::vector<Fault>& faults, const Config& config) {
  std::vector<FaultTarget> targets;
  for (const LidarOptions& lidar : config.lidars) {
    for (const Fault& fault : faults) {
      if (lidar.gives_clouds() && fault.strikes_lidar(lidar.name))
        throw Failure(ExitStatus::wrong_usage,
                      fmt::format("--fail {}: lidar {} has clouds, and faults apply to packets only; choose a motion "
                                  "source",
                                  fault.name, lidar.name));
    }
    targets.push_back({lidar.name, FaultTarget::Kind::lidar});
    targets.push_back({lidar.name + std::string{Fault::kPositionPackets}, FaultTarget::Kind::position_packets});
  }
  for (const MotionSourceOptions& source : config.motion_sources)
    targets.push_back(
        {source.name, source.kind == SourceKind::imu ? FaultTarget::Kind::imu : FaultTarget::Kind::odometry});
  for (const Fault& fault : faults) {
    if (const auto problem = fault_problem(fault, targets))
      throw Failure(ExitStatus::wrong_usage, *problem);
  }
}

Recording::Recording(std::unique_ptr<DatagramSource> source, std::vector<MotionRecording> motion, const Config& config,
                     LidarRouter lidars, const PlayOptions& options)
    : lidars_(std::move(lidars)), source_(std::make_unique<SteadyArrivals>(
                                      std::make_unique<RecordedTimes>(std::move(source), config.lidars), lidars_)),
      play_for_(options.duration), head_(source_->next()),
      capture_start_(head_ != nullptr ? head_->receive_stamp : Stamp{}), injected_(options.faults) {
  begin_ = capture_start_ + options.start;
  end_ = play_for_ ? begin_ + *play_for_ : Stamp::max();
  if (!options.faults.empty())
    faults_.emplace(options.faults, capture_start_, options.seed);
  for (MotionRecording& recording : motion) {
    const std::string& name = config.motion_sources[index_of(recording.source)].name;
    const bool has_faults = std::ranges::find(options.faults, name, &Fault::name) != options.faults.end();
    if (has_faults)
      std::visit([&](auto& samples) { samples = with_faults(samples.drain(), options, name, capture_start_); },
                 recording.samples);
    else
      std::visit([&](auto& samples) { samples = in_order(std::move(samples), capture_start_); }, recording.samples);
    const std::size_t index = index_of(recording.source);
    const Duration earlier = index < options.earlier.size() ? options.earlier[index] : Duration{};
    motion_.push_back({std::move(recording), has_faults, earlier, ClockFollower(capture_start_), &source_->steps()});
  }
}

/// Keeps a sample from arriving before it is measured, if one clock determines both stamps.
Stamp Recording::MotionCursor::arrival() const {
  return std::visit(
      [&](const auto& samples) {
        const auto* const next = samples.front();
        if (next == nullptr)
          return Stamp::max();
        const Stamp steady = clock.peek(next->arrival, *steps);
        const Stamp in_time = steady - std::max(earlier, Duration{});
        const Duration transit = next->arrival - next->stamp;
        const bool one_clock = std::chrono::abs(transit) < std::chrono::seconds{1};
        return earlier != Duration{} && one_clock ? std::max(in_time, steady - transit - earlier) : in_time;
      },
      recording.samples);
}

std::optional<TimeSpan> Recording::MotionCursor::arrivals() const {
  return std::visit([](const auto& samples) { return samples.arrivals(); }, recording.samples);
}

Input Recording::MotionCursor::pop() {
  const auto input_of = [&](auto sample) -> Input {
    const Stamp arrives = arrival();
    const Duration step = sample.arrival - clock.pass(sample.arrival, *steps);
    const bool one_clock = std::chrono::abs(sample.arrival - sample.stamp) < kLongestTransit;
    sample.arrival = arrives;
    sample.stamp -= earlier + (one_clock ? step : Duration{});
    if constexpr (std::is_same_v<std::decay_t<decltype(sample)>, ImuSample>)
      return daemon::ImuInput{recording.source, sample};
    else
      return daemon::OdometryInput{recording.source, sample};
  };
  return std::visit(
      [&](auto& samples) {
        Input input = input_of(*samples.front());
        samples.pop();
        return input;
      },
      recording.samples);
}

Input Recording::next(Duration) {
  if (!pending_)
    pending_ = fetch();
  if (!std::exchange(has_begun_, true))
    skip_motion();
  const auto earliest = std::ranges::min_element(motion_, {}, &MotionCursor::arrival);
  if (earliest != motion_.end() && earliest->arrival() <= pending_->arrival) {
    earliest->is_used = true;
    return earliest->pop();
  }
  Input input = pending_->input;
  pending_.reset();
  return input;
}

/// Skips the samples well before the part played. Steps of the clock before it are known by now.
void Recording::skip_motion() {
  for (MotionCursor& cursor : motion_) {
    while (cursor.arrival() < begin_ - kMotionAhead)
      cursor.pop();
  }
}

/// Returns the next datagram of the part played, or nullptr from its end on.
const Datagram* Recording::read() {
  while (!capture_is_over_) {
    const Datagram* datagram = head_ != nullptr ? std::exchange(head_, nullptr) : source_->next();
    if (datagram != nullptr) {
      backwards_ += read_++ > 0 && datagram->receive_stamp < latest_read_ ? 1U : 0U;
      latest_read_ = datagram->receive_stamp;
    }
    capture_is_over_ = datagram == nullptr || datagram->receive_stamp >= end_;
    if (!capture_is_over_ && datagram->receive_stamp >= begin_)
      return datagram;
  }
  return nullptr;
}

Recording::Pending Recording::fetch() {
  const auto keep = [this](const Datagram& datagram) {
    faulty_.push_back({datagram, {datagram.payload.begin(), datagram.payload.end()}});
  };
  if (faulty_.empty()) {
    const Datagram* datagram = read();
    if (datagram != nullptr) {
      note(*datagram);
      if (datagram->cloud != nullptr)
        return {daemon::CloudInput{datagram->lidar, datagram->cloud, datagram->receive_stamp, {}},
                datagram->receive_stamp};
      if (!faults_)
        return {*datagram, datagram->receive_stamp};
      faults_->pass(lidars_.configured_for(*datagram), *datagram, keep);
      if (faulty_.empty())
        return {Silence{datagram->receive_stamp}, datagram->receive_stamp};
    } else if (faults_) {
      faults_->finish(keep);
    }
  }
  if (faulty_.empty())
    return {EndOfInput{}, last_};
  given_out_ = std::move(faulty_.front());
  faulty_.pop_front();
  given_out_.datagram.payload = given_out_.payload;
  return {given_out_.datagram, given_out_.datagram.receive_stamp};
}

void Recording::note(const Datagram& datagram) {
  const Stamp now = datagram.receive_stamp;
  first_ = started_ ? std::min(first_, now) : now;
  last_ = started_ ? std::max(last_, now) : now;
  started_ = true;
  if (datagram.cloud == nullptr)
    note_traffic(datagram);
  if (play_for_)
    progress_.store(to_seconds(now - begin_) / to_seconds(*play_for_), std::memory_order_relaxed);
  else
    progress_.store(source_->progress(), std::memory_order_relaxed);
}

void Recording::note_traffic(const Datagram& datagram) {
  PortTraffic& traffic = traffic_[datagram.destination_port];
  ++traffic.datagrams;
  ++traffic.by_length[datagram.payload.size()];
  traffic.source_ip = datagram.source_ip;
  traffic.bytes = datagram.payload.size();
  if (const std::optional<OtherMaker> maker = other_maker(datagram))
    ++traffic.of_other_maker[static_cast<std::size_t>(*maker)];
  traffic.of_ouster_imu += is_ouster_imu(datagram) ? 1U : 0U;
  if (const auto looks = hesai::look_at(datagram.payload); looks && !looks->model)
    traffic.hesai = looks->name;
}

std::optional<std::string> Recording::runs_backwards() const {
  if (2 * backwards_ <= read_)
    return std::nullopt;
  return fmt::format("{} of its {} datagrams are older than the one before them: it runs backwards in time; put it in "
                     "order with: reordercap IN OUT (of Debian's wireshark-common), and replay OUT",
                     backwards_, read_);
}

const std::filesystem::path* Recording::file_of(SourceId source) const {
  const auto found =
      std::ranges::find_if(motion_, [&](const MotionCursor& cursor) { return cursor.recording.source == source; });
  return found == motion_.end() ? nullptr : &found->recording.file;
}

std::vector<std::string> Recording::warnings() const {
  std::vector<std::string> warnings = source_->warnings();
  for (const MotionCursor& motion : motion_) {
    if (motion.clock.own_steps() > 0)
      warnings.push_back(fmt::format("{}: its times jump {} times, first by {:+.3f} s at {:.3f} s, but those of the "
                                     "lidar do not: its clock was set, and the times continue from before",
                                     motion.recording.file.string(), motion.clock.own_steps(),
                                     to_seconds(motion.clock.first_own_step().by),
                                     to_seconds(motion.clock.first_own_step().at.time_since_epoch())));
    const std::optional<TimeSpan> span = motion.arrivals();
    if (started_ && !motion.has_faults && !motion.is_used)
      warnings.push_back(fmt::format("{}: its samples ({}) and the packets ({}) have no time in common, so nothing of "
                                     "it was used; name a file that was recorded with them, by the same clock",
                                     motion.recording.file.string(), text_of(span), text_of(TimeSpan{first_, last_})));
  }
  return warnings;
}

} // namespace locus::tools
