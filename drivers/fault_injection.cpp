// SPDX-License-Identifier: Apache-2.0
#include "drivers/fault_injection.hpp"

#include <algorithm>
#include <chrono>
#include <limits>
#include <utility>

#include "drivers/position_packet.hpp"
#include "drivers/velodyne_model.hpp"
#include "drivers/wire.hpp"

namespace locus {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

void copy_reading(const ImuSample& from, ImuSample& to) {
  to.angular_velocity_radps = from.angular_velocity_radps;
  to.specific_force_mps2 = from.specific_force_mps2;
  to.attitude = from.attitude;
}

void copy_reading(const OdometrySample& from, OdometrySample& to) { to.T_source_base = from.T_source_base; }

void distort_reading(const FaultPlan::Verdict& verdict, ImuSample& sample) {
  if (verdict.nan) {
    sample.angular_velocity_radps.setConstant(kNan);
    sample.specific_force_mps2.setConstant(kNan);
    if (sample.attitude) {
      sample.attitude->coeffs().setConstant(kNan);
    }
  }
}

void distort_reading(const FaultPlan::Verdict& verdict, OdometrySample& sample) {
  sample.T_source_base.translation.x() += verdict.jump_m;
  sample.covariance_scale *= verdict.covariance_scale;
  if (verdict.nan) {
    sample.T_source_base.translation.setConstant(kNan);
    sample.T_source_base.rotation.coeffs().setConstant(kNan);
  }
}

/// Where a packet holds the sensor's clock, microseconds past the hour; nullptr for a packet without.
std::byte* sensor_clock_in(std::vector<std::byte>& payload) {
  switch (payload.size()) {
  case velodyne::kDataPacketBytes:
    return payload.data() + velodyne::kTimeOffset;
  case velodyne::kPositionPacketBytes:
    return payload.data() + velodyne::kTimeOfHourOffset;
  default:
    return nullptr;
  }
}

void step_sensor_clock(std::vector<std::byte>& payload, Duration step) {
  using std::chrono::microseconds;
  constexpr microseconds kHour = std::chrono::hours{1};
  std::byte* const clock = sensor_clock_in(payload);
  if (clock == nullptr || step == Duration::zero()) {
    return;
  }
  const microseconds stepped = microseconds{read_u32(clock)} + std::chrono::duration_cast<microseconds>(step);
  const auto time_of_hour_us = static_cast<std::uint32_t>(((stepped % kHour + kHour) % kHour).count());
  for (unsigned i = 0; i < 4; ++i) {
    clock[i] = static_cast<std::byte>(time_of_hour_us >> 8 * i);
  }
}

} // namespace

template <class Sample> void SampleFaults<Sample>::pass(Sample sample, const Emit& emit) {
  const FaultPlan::Verdict verdict = plan_.judge(source_, false, sample.arrival);
  if (verdict.frozen && healthy_) {
    copy_reading(*healthy_, sample);
  } else {
    healthy_ = sample;
  }
  if (verdict.lost) {
    return;
  }
  distort_reading(verdict, sample);
  sample.stamp += verdict.clock_step;
  sample.arrival += verdict.delay;
  if (verdict.overtaken && !overtaken_) {
    overtaken_ = sample;
    return;
  }
  emit(sample);
  if (verdict.duplicated) {
    emit(sample);
  }
  if (std::optional<Sample> overtaken = std::exchange(overtaken_, std::nullopt)) {
    overtaken->arrival = std::max(overtaken->arrival, sample.arrival);
    emit(*overtaken);
  }
}

template <class Sample> void SampleFaults<Sample>::finish(const Emit& emit) {
  if (const std::optional<Sample> overtaken = std::exchange(overtaken_, std::nullopt)) {
    emit(*overtaken);
  }
}

template class SampleFaults<ImuSample>;
template class SampleFaults<OdometrySample>;

template <class Sample>
void inject_faults(std::span<const Fault> faults, const std::string& source, Stamp capture_start, std::uint64_t seed,
                   std::vector<Sample>& samples) {
  SampleFaults<Sample> injection(faults, source, capture_start, seed);
  std::vector<Sample> arriving;
  arriving.reserve(samples.size());
  const auto keep = [&](const Sample& sample) { arriving.push_back(sample); };
  for (const Sample& sample : samples) {
    injection.pass(sample, keep);
  }
  injection.finish(keep);
  std::ranges::stable_sort(arriving, {}, &Sample::arrival);
  samples = std::move(arriving);
}

template void inject_faults(std::span<const Fault>, const std::string&, Stamp, std::uint64_t, std::vector<ImuSample>&);
template void inject_faults(std::span<const Fault>, const std::string&, Stamp, std::uint64_t,
                            std::vector<OdometrySample>&);

void DatagramFaults::Copy::emit_to(const Emit& emit) const {
  Datagram complete = datagram;
  complete.payload = payload;
  emit(complete);
}

void DatagramFaults::pass(std::string_view lidar, const Datagram& datagram, const Emit& emit) {
  const Stamp now = datagram.receive_stamp;
  emit_delayed(now, emit);
  if (lidar.empty()) {
    emit(datagram);
    return;
  }
  const FaultPlan::Verdict verdict = plan_.judge(lidar, true, now);
  LidarState& state = lidars_[std::string{lidar}];
  const bool is_data = datagram.payload.size() == velodyne::kDataPacketBytes;
  if (is_data && (!verdict.frozen || state.last_data_packet.empty())) {
    state.last_data_packet.assign(datagram.payload.begin(), datagram.payload.end());
  }
  if (verdict.lost) {
    return;
  }
  if (verdict.harmless() && !state.overtaken) {
    emit(datagram);
    return;
  }
  Copy copy{datagram, {datagram.payload.begin(), datagram.payload.end()}};
  if (verdict.frozen && is_data) {
    copy.payload = state.last_data_packet;
  }
  step_sensor_clock(copy.payload, verdict.clock_step);
  copy.datagram.receive_stamp += verdict.delay;
  if (verdict.overtaken && !state.overtaken) {
    state.overtaken = std::move(copy);
    return;
  }
  const Stamp arrival = copy.datagram.receive_stamp;
  if (verdict.duplicated) {
    deliver(copy, now, emit);
  }
  deliver(std::move(copy), now, emit);
  if (std::optional<Copy> overtaken = std::exchange(state.overtaken, std::nullopt)) {
    overtaken->datagram.receive_stamp = std::max(overtaken->datagram.receive_stamp, arrival);
    deliver(*std::move(overtaken), now, emit);
  }
}

void DatagramFaults::finish(const Emit& emit) {
  for (auto& [name, state] : lidars_) {
    if (std::optional<Copy> overtaken = std::exchange(state.overtaken, std::nullopt)) {
      const Stamp arrival = overtaken->datagram.receive_stamp;
      delayed_.emplace(arrival, *std::move(overtaken));
    }
  }
  emit_delayed(Stamp::max(), emit);
}

void DatagramFaults::deliver(Copy copy, Stamp now, const Emit& emit) {
  if (const Stamp arrival = copy.datagram.receive_stamp; arrival > now) {
    delayed_.emplace(arrival, std::move(copy));
  } else {
    copy.emit_to(emit);
  }
}

void DatagramFaults::emit_delayed(Stamp now, const Emit& emit) {
  while (!delayed_.empty() && delayed_.begin()->first <= now) {
    const auto due = delayed_.extract(delayed_.begin());
    due.mapped().emit_to(emit);
  }
}

} // namespace locus
