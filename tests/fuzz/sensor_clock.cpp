// SPDX-License-Identifier: Apache-2.0
// The clock of a lidar, with arbitrary times of hour and reception.
#include "drivers/sensor_clock.hpp"
#include "fuzz/packet_stream.hpp"

namespace locus {
namespace {

using std::chrono::microseconds;

constexpr Duration kPacket = microseconds{1327};

/// Bits of a step's first byte.
enum Step : std::uint8_t { kAnyTimeOfHour = 1, kAnyReception = 2, kBackwards = 4, kUnsynchronised = 8 };

Duration wrapped(Duration time_of_hour) { return time_of_hour % std::chrono::hours{1}; }

/// A working lidar must be accepted, whatever the input before.
void demand_that_a_living_lidar_is_heard(SensorClock& clock, Duration time_of_hour, Duration received) {
  std::optional<SensorClock::Reading> reading;
  for (int packet = 1; packet <= 200; ++packet)
    reading = clock.read(wrapped(time_of_hour + packet * kPacket), kPacket, Stamp{received + packet * kPacket});
  fuzz::demand(reading.has_value());
}

} // namespace
} // namespace locus

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locus;
  fuzz::FuzzBytes bytes{data, size};
  SensorClock clock{static_cast<LidarTime>(bytes.take<std::uint8_t>() % 3)};
  Duration time_of_hour{};
  Duration received = std::chrono::hours{472'222};
  std::uint64_t steps = 0;
  while (!bytes.empty()) {
    const auto step = bytes.take<std::uint8_t>();
    clock.set_synchronised((step & kUnsynchronised) == 0);
    const Duration later = microseconds{bytes.take<std::uint16_t>()};
    const Duration jitter = microseconds{bytes.take<std::int16_t>()};
    received += later + jitter;
    time_of_hour = wrapped(time_of_hour + later);
    if ((step & kBackwards) != 0)
      time_of_hour = wrapped(time_of_hour + std::chrono::hours{1} - 2 * later);
    if ((step & kAnyTimeOfHour) != 0)
      time_of_hour = wrapped(microseconds{bytes.take<std::uint32_t>()});
    if ((step & kAnyReception) != 0)
      received = fuzz::PacketStream::any_stamp(bytes).time_since_epoch();
    const auto reading = clock.read(time_of_hour, kPacket, Stamp{received});
    fuzz::demand(clock.steps() >= steps);
    fuzz::demand(!reading || reading->continuous || reading->advance == Duration{});
    steps = clock.steps();
  }
  demand_that_a_living_lidar_is_heard(clock, time_of_hour, received);
  return 0;
}
