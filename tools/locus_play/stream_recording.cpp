// SPDX-License-Identifier: Apache-2.0
#include "locus_play/stream_recording.hpp"

#include <utility>

#include "drivers/files/motion_files.hpp"

namespace locus::tools {

using daemon::EndOfInput;
using daemon::Input;
using daemon::Silence;

CaptureStream::CaptureStream(Capture capture) : capture_(std::move(capture)), head_(capture_.next()) {
  const auto text = head_ != nullptr ? sim::StreamText::of(*head_) : std::nullopt;
  if (text && text->file == "config.yaml")
    config_ = text->lines;
}

const Datagram* CaptureStream::next() { return head_ != nullptr ? std::exchange(head_, nullptr) : capture_.next(); }

StreamRecording::StreamRecording(CaptureStream& stream, const Config& config, LidarRouter lidars,
                                 std::vector<Fault> faults)
    : stream_(stream), config_(config), lidars_(std::move(lidars)), faults_(std::move(faults)) {}

Input StreamRecording::next(Duration) {
  while (now_ != Stamp::max() && (waiting_.empty() || waiting_.begin()->first > now_))
    read();
  if (waiting_.empty())
    return EndOfInput{};
  current_ = std::move(waiting_.extract(waiting_.begin()).mapped());
  if (auto* datagram = std::get_if<Datagram>(&current_.input))
    datagram->payload = current_.payload;
  return current_.input;
}

void StreamRecording::read() {
  const Datagram* datagram = problem_ ? nullptr : stream_.next();
  if (datagram == nullptr) {
    end();
    return;
  }
  now_ = datagram->receive_stamp;
  if (!lidar_faults_)
    begin(now_);
  if (const auto text = sim::StreamText::of(*datagram)) {
    read_text(*text, now_);
    return;
  }
  const std::size_t waiting = waiting_.size();
  lidar_faults_->pass(lidars_.configured_for(*datagram), *datagram, [this](const Datagram& d) { enqueue(d); });
  if (waiting_.size() == waiting)
    waiting_.emplace(now_, OwnedInput{Silence{now_}, {}});
}

void StreamRecording::begin(Stamp start) {
  const std::uint64_t seed = config_.sweep.seed;
  lidar_faults_.emplace(faults_, start, seed);
  bool has_imu = false; // imu.csv belongs to the first one
  for (std::size_t i = 0; i < config_.motion_sources.size(); ++i) {
    const MotionSourceOptions& source = config_.motion_sources[i];
    if (source.kind == SourceKind::odometry)
      sources_.emplace(source.name + ".tum",
                       Source{SourceId{i}, SampleFaults<OdometrySample>(faults_, source.name, start, seed)});
    else if (!std::exchange(has_imu, true))
      sources_.emplace("imu.csv", Source{SourceId{i}, SampleFaults<ImuSample>(faults_, source.name, start, seed)});
  }
}

void StreamRecording::read_text(const sim::StreamText& text, Stamp arrival) {
  const auto source = sources_.find(std::string(text.file));
  if (source != sources_.end())
    std::visit([&]<class Sample>(SampleFaults<Sample>&) { read_samples<Sample>(text, arrival, source->second); },
               source->second.faults);
  else if (text.file != "gt.tum" && text.file != "config.yaml")
    unknown_files_.emplace(text.file);
}

template <class Sample> void StreamRecording::read_samples(const sim::StreamText& text, Stamp arrival, Source& source) {
  auto samples = parse_samples<Sample>(std::string(text.lines), std::string(text.file));
  if (!samples) {
    problem_ = samples.error();
    return;
  }
  for (Sample& sample : *samples) {
    sample.arrival = arrival;
    std::get<SampleFaults<Sample>>(source.faults).pass(sample, [&](const Sample& s) { enqueue(source.id, s); });
  }
}

void StreamRecording::enqueue(const Datagram& datagram) {
  waiting_.emplace(datagram.receive_stamp, OwnedInput{datagram, {datagram.payload.begin(), datagram.payload.end()}});
}

void StreamRecording::enqueue(SourceId source, const ImuSample& sample) {
  waiting_.emplace(sample.arrival, OwnedInput{daemon::ImuInput{source, sample}, {}});
}

void StreamRecording::enqueue(SourceId source, const OdometrySample& sample) {
  waiting_.emplace(sample.arrival, OwnedInput{daemon::OdometryInput{source, sample}, {}});
}

void StreamRecording::end() {
  now_ = Stamp::max();
  if (!lidar_faults_)
    return;
  lidar_faults_->finish([this](const Datagram& datagram) { enqueue(datagram); });
  for (auto& entry : sources_) {
    Source& source = entry.second;
    std::visit(
        [&]<class Sample>(SampleFaults<Sample>& faults) {
          faults.finish([&](const Sample& sample) { enqueue(source.id, sample); });
        },
        source.faults);
  }
}

} // namespace locus::tools
