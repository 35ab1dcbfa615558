// SPDX-License-Identifier: Apache-2.0
// Packets of a Hesai: arbitrary bytes, and well-formed packets with some bytes changed.
#include <chrono>
#include <cmath>
#include <memory>
#include <vector>

#include "drivers/hesai/decoder.hpp"
#include "drivers/hesai_test_packet.hpp"
#include "fuzz/fuzz_bytes.hpp"

namespace locus {
namespace {

using fuzz::demand;

/// Bits of a packet's first byte.
enum Step : std::uint8_t { kAnyBytes = 1, kOtherLength = 2, kUnsealed = 4, kOtherModel = 8, kLater = 16 };

void check(const hesai::Decoder& decoder, const LidarPacket& packet) {
  constexpr Duration kLongest = std::chrono::seconds{1};
  const std::size_t channels = hesai::spec(*decoder.model()).layout.channels;
  demand(packet.count > 0 && packet.count <= LidarPacket::kMaxFiringGroups && packet.first_azimuth_cdeg < 36000);
  demand(packet.duration > Duration{} && packet.duration < kLongest);
  demand(decoder.time() >= Duration{} && Stamp{decoder.time()} < kLatestStamp + kLongest);
  for (const FiringGroup& group : packet.firing_groups()) {
    demand(group.first_laser < channels);
    for (std::size_t k = 0; k < FiringGroup::kLasers; ++k) {
      const bool is_channel = group.first_laser + k < channels;
      demand(is_channel || group.range_m[k] == 0.0F);
      if (!is_channel)
        continue;
      demand(std::isfinite(group.x_m[k] + group.y_m[k] + group.z_m[k]) && group.range_m[k] >= 0.0F);
      demand(group.ring[k] < channels);
      demand(Duration{std::abs(group.offset_ns[k])} < packet.duration + decoder.nominal_duration());
    }
  }
}

std::vector<std::byte> lidar_packet(fuzz::FuzzBytes& bytes, hesai::Model model, std::uint8_t step, Duration time) {
  constexpr std::array<std::uint8_t, 4> kModes{0x37, 0x39, 0x3D, 0x33};
  const std::uint8_t mode = kModes[bytes.take<std::uint8_t>() % (model == hesai::Model::xt32m ? 4U : 2U)];
  test::HesaiTestPacket packet{model,
                               mode,
                               time,
                               static_cast<std::uint16_t>(bytes.take<std::uint16_t>() % 36000),
                               static_cast<double>(bytes.take<std::int8_t>()) * 10.0,
                               bytes.take<std::uint8_t>() % 2U};
  if ((step & kAnyBytes) != 0)
    for (std::size_t at = 0; at < packet.payload().size() && !bytes.empty(); ++at)
      packet.set_byte(at, bytes.take<std::uint8_t>());
  for (std::uint8_t changes = bytes.take<std::uint8_t>() % 8; changes > 0; --changes) {
    const auto at = bytes.take<std::uint16_t>();
    packet.set_byte(at % packet.payload().size(), bytes.take<std::uint8_t>());
  }
  if ((step & kUnsealed) == 0)
    packet.seal();
  std::vector<std::byte> payload{packet.payload().begin(), packet.payload().end()};
  if ((step & kOtherLength) != 0)
    payload.resize(bytes.take<std::uint16_t>() % 2048U);
  return payload;
}

} // namespace
} // namespace locus

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locus;
  fuzz::FuzzBytes bytes{data, size};
  const auto any_model = [&bytes] { return static_cast<hesai::Model>(bytes.take<std::uint8_t>() % hesai::kModels); };
  hesai::Model model = any_model();
  hesai::DecoderOptions options;
  if (bytes.take<std::uint8_t>() % 2 == 0)
    options.model = model;
  const auto decoder = std::make_unique<hesai::Decoder>(options);
  const auto packet = std::make_unique<LidarPacket>();
  constexpr int kLongestStream = 16;
  Duration time = test::HesaiTestPacket::kTime;
  for (int packets = 0; packets < kLongestStream && !bytes.empty(); ++packets) {
    const auto step = bytes.take<std::uint8_t>();
    if ((step & kOtherModel) != 0)
      model = any_model();
    if ((step & kLater) != 0)
      time += std::chrono::microseconds{bytes.take<std::uint16_t>()};
    if (!decoder->decode(lidar_packet(bytes, model, step, time), *packet))
      check(*decoder, *packet);
  }
  return 0;
}
