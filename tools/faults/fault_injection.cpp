// SPDX-License-Identifier: Apache-2.0
#include "faults/fault_injection.hpp"

#include <algorithm>
#include <bit>
#include <limits>
#include <random>
#include <utility>

#include "drivers/ouster/imu_packet.hpp"
#include "drivers/ouster/packet_edit.hpp"
#include "drivers/packet_edit.hpp"
#include "drivers/velodyne/position_packet.hpp"

namespace locus {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

void copy_reading(const ImuSample& from, ImuSample& to) {
  to.angular_velocity_radps = from.angular_velocity_radps;
  to.specific_force_mps2 = from.specific_force_mps2;
  to.attitude = from.attitude;
}

void copy_reading(const OdometrySample& from, OdometrySample& to) { to.T_source_base = from.T_source_base; }

/// Replaces the numbers by random bits: any magnitude, no unit quaternion, sometimes infinite or NaN.
void corrupt_reading(std::uint64_t seed, std::initializer_list<std::span<double>> numbers) {
  std::mt19937_64 random{seed};
  for (const std::span<double> part : numbers) {
    std::ranges::generate(part, [&] { return std::bit_cast<double>(random()); });
  }
}

template <class Vector> std::span<double> numbers_of(Vector& vector) {
  return {vector.data(), static_cast<std::size_t>(vector.size())};
}

void distort_reading(const FaultPlan::Verdict& verdict, ImuSample& sample) {
  sample.angular_velocity_radps.z() += verdict.jump;
  if (verdict.corruption) {
    corrupt_reading(*verdict.corruption,
                    {numbers_of(sample.angular_velocity_radps), numbers_of(sample.specific_force_mps2)});
  }
  if (verdict.nan) {
    sample.angular_velocity_radps.setConstant(kNan);
    sample.specific_force_mps2.setConstant(kNan);
    if (sample.attitude) {
      sample.attitude->coeffs().setConstant(kNan);
    }
  }
}

void distort_reading(const FaultPlan::Verdict& verdict, OdometrySample& sample) {
  sample.T_source_base.translation.x() += verdict.jump;
  sample.covariance_scale *= verdict.covariance_scale;
  if (verdict.corruption) {
    corrupt_reading(*verdict.corruption,
                    {numbers_of(sample.T_source_base.translation), numbers_of(sample.T_source_base.rotation.coeffs())});
  }
  if (verdict.nan) {
    sample.T_source_base.translation.setConstant(kNan);
    sample.T_source_base.rotation.coeffs().setConstant(kNan);
  }
}

/// Randomises the payload from a random byte on.
void corrupt_payload(std::uint64_t seed, std::vector<std::byte>& payload) {
  if (payload.empty()) {
    return;
  }
  std::mt19937_64 random{seed};
  const auto from = payload.begin() + static_cast<std::ptrdiff_t>(random() % payload.size());
  std::generate(from, payload.end(), [&] { return static_cast<std::byte>(random()); });
}

void distort_packet(const FaultPlan::Verdict& verdict, const ouster::Metadata* ouster, bool inertial,
                    std::vector<std::byte>& payload) {
  if (verdict.clock_step != Duration::zero()) {
    shift_clock(payload, ouster, verdict.clock_step);
  }
  if (verdict.jump != 0.0 && inertial) {
    ouster::add_turn(*ouster, payload, verdict.jump);
  } else if (verdict.jump != 0.0) {
    lengthen_ranges(payload, ouster, verdict.jump);
  }
  if (verdict.view_deg < 360.0) {
    narrow_view(payload, ouster, verdict.view_deg);
  }
  if (verdict.nan && inertial) {
    ouster::make_nan(*ouster, payload);
  }
  if (verdict.corruption) {
    corrupt_payload(*verdict.corruption, payload);
  }
}

bool is_inertial(const LidarRouter::Origin& origin, const Datagram& datagram) {
  return origin.metadata != nullptr && datagram.payload.size() == ouster::imu_packet_layout(*origin.metadata).bytes;
}

/// Returns the name of the stream that a lidar's datagram belongs to: position packets form a stream of their own, and
/// so do packets with readings of an inertial unit.
std::string stream_of(const LidarRouter::Origin& origin, const Datagram& datagram) {
  std::string stream{origin.lidar};
  if (is_inertial(origin, datagram)) {
    stream += Fault::kInertialUnit;
  } else if (origin.metadata == nullptr && datagram.payload.size() == velodyne::kPositionPacketBytes) {
    stream += Fault::kPositionPackets;
  }
  return stream;
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

void DatagramFaults::pass(const LidarRouter::Origin& origin, const Datagram& datagram, const Emit& emit) {
  const Stamp now = datagram.receive_stamp;
  emit_delayed(now, emit);
  if (origin.lidar.empty()) {
    emit(datagram);
    return;
  }
  const std::string name = stream_of(origin, datagram);
  const FaultPlan::Verdict verdict = plan_.judge(name, true, now);
  Stream& stream = streams_[name];
  if (!verdict.frozen || stream.healthy.empty()) {
    stream.healthy.assign(datagram.payload.begin(), datagram.payload.end());
  }
  if (verdict.lost) {
    return;
  }
  if (verdict.harmless() && !stream.overtaken) {
    emit(datagram);
    return;
  }
  Copy copy{datagram, {datagram.payload.begin(), datagram.payload.end()}};
  if (verdict.frozen) {
    copy.payload = stream.healthy;
  }
  distort_packet(verdict, origin.metadata, is_inertial(origin, datagram), copy.payload);
  copy.datagram.receive_stamp += verdict.delay;
  if (verdict.overtaken && !stream.overtaken) {
    stream.overtaken = std::move(copy);
    return;
  }
  const Stamp arrival = copy.datagram.receive_stamp;
  if (verdict.duplicated) {
    deliver(copy, now, emit);
  }
  deliver(std::move(copy), now, emit);
  if (std::optional<Copy> overtaken = std::exchange(stream.overtaken, std::nullopt)) {
    overtaken->datagram.receive_stamp = std::max(overtaken->datagram.receive_stamp, arrival);
    deliver(*std::move(overtaken), now, emit);
  }
}

void DatagramFaults::finish(const Emit& emit) {
  for (auto& [name, stream] : streams_) {
    if (std::optional<Copy> overtaken = std::exchange(stream.overtaken, std::nullopt)) {
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
