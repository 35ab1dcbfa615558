// SPDX-License-Identifier: Apache-2.0
// Comparison with the output of another decoder, nebula, on recordings.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "bags/bag.hpp"
#include "bags/messages.hpp"
#include "drivers/hesai/calibration.hpp"
#include "drivers/hesai/decoder.hpp"
#include "drivers/reference_data.hpp"
#include "drivers/wire.hpp"
#include "support/test_data.hpp"

namespace locus::hesai {
namespace {

#define SKIP_WITHOUT(file)                                                                                             \
  if (!std::filesystem::exists(file))                                                                                  \
  GTEST_SKIP() << (file) << " is not there; LOCUS_TEST_DATA names the folder of the real captures"

struct Recorded {
  std::string folder, angles;
  Model model;
  double rpm;
  double least_range_m; ///< minimum range of the other decoder
};

void PrintTo(const Recorded& recorded, std::ostream* out) { *out << recorded.folder; }

std::filesystem::path hesai_data(const std::string& name) { return test::test_data() / "hesai" / name; }

/// Returns the packets of a bag in order.
std::vector<std::vector<std::byte>> packets_of(const std::string& folder) {
  std::vector<std::vector<std::byte>> payloads;
  const auto bag = tools::open_bag(hesai_data(folder));
  EXPECT_TRUE(bag) << bag.error();
  if (!bag)
    return payloads;
  const tools::PacketType* const type = tools::packet_type((*bag)->topics().front().type);
  while (const tools::BagMessage* message = (*bag)->next()) {
    const auto scan = type->read({message->data, (*bag)->topics()[message->topic].serialisation});
    EXPECT_TRUE(scan);
    for (const auto& packet : scan->packets) {
      const auto payload = scan->payload(packet);
      payloads.emplace_back(payload.begin(), payload.end());
    }
  }
  return payloads;
}

struct Point {
  float x, y, z;
};

/// Converts the decoder's returns to the clouds of the other decoder:
/// - axes of the maker: x right, y along azimuth 0;
/// - all lasers of a block have the block's azimuth, without the rotation until they fire;
/// - of two returns of a pulse that are closer than 10 cm it uses the second, which may equal the first;
/// - returns nearer than its minimum range are dropped;
/// - a cloud spans azimuth 0 to the next azimuth 0, by the azimuth of each laser itself.
class OtherDecoder {
 public:
  explicit OtherDecoder(const Recorded& recorded, const Calibration& calibration)
      : recorded_(recorded), calibration_(calibration), decoder_({recorded.model, calibration}) {}

  void take(std::span<const std::byte> payload) {
    ASSERT_EQ(decoder_.decode(payload, packet_), std::nullopt);
    ASSERT_EQ(decoder_.model(), recorded_.model);
    EXPECT_NEAR(decoder_.rotation_rate_rpm(), recorded_.rpm, 2.0);
    const std::size_t banks = (calibration_.laser_count + FiringGroup::kLasers - 1) / FiringGroup::kLasers;
    const std::size_t returns = returns_of(*decoder_.return_mode());
    ASSERT_EQ(returns, 2U);
    const FiringGroup* groups = packet_.storage.data();
    for (std::size_t column = 0; column < spec(recorded_.model).layout.blocks / returns; ++column) {
      begin_column(payload, column, returns);
      for (std::size_t first = 0; first < banks * FiringGroup::kLasers; first += FiringGroup::kLasers) {
        if (groups->first_laser != first)
          continue; // a bank that does not fire in this column
        for (std::size_t k = 0; k < FiringGroup::kLasers && first + k < calibration_.laser_count; ++k)
          take_pair(groups[0][k], groups[1][k], first + k);
        groups += returns;
      }
    }
    EXPECT_EQ(groups, packet_.storage.data() + packet_.count);
  }

  [[nodiscard]] const std::map<long, std::vector<Point>>& clouds() const { return clouds_; }

 private:
  void begin_column(std::span<const std::byte> payload, std::size_t column, std::size_t returns) {
    const PacketLayout& layout = spec(recorded_.model).layout;
    const std::byte* const block = payload.data() + layout.header + column * returns * layout.block();
    const double azimuth_deg = 0.01 * (std::to_integer<int>(block[layout.block_header - 2]) |
                                       std::to_integer<int>(block[layout.block_header - 1]) << 8);
    turns_ += azimuth_deg < azimuth_deg_ ? 1 : 0;
    azimuth_deg_ = azimuth_deg;
    const std::size_t tail = layout.body() + 4 + 17;
    sequence_ = recorded_.model == Model::qt128 ? (std::to_integer<std::size_t>(payload[tail + 5]) + 1) % 2 : 0;
  }

  void take_pair(const LidarReturn& first, LidarReturn second, std::size_t channel) {
    if (second.range_m == 0.0F && first.range_m > 0.0F && is_equal_return(first, second))
      second = first;
    if (std::abs(first.range_m - second.range_m) >= 0.1F)
      take_return(first, channel);
    take_return(second, channel);
  }

  /// A second return at the range of the first is dropped, but its coordinates are still stored.
  static bool is_equal_return(const LidarReturn& first, const LidarReturn& second) {
    return first.x_m == second.x_m && first.y_m == second.y_m && first.z_m == second.z_m;
  }

  void take_return(const LidarReturn& one, std::size_t channel) {
    if (static_cast<double>(one.range_m) < recorded_.least_range_m - 1e-4)
      return;
    const double since_azimuth_s = 1e-9 * spec(recorded_.model).sequences[sequence_].offset_ns[channel];
    const double turned_rad = decoder_.rotation_rate_rpm() / 60.0 * 2.0 * std::numbers::pi * since_azimuth_s;
    const double cos = std::cos(turned_rad), sin = std::sin(turned_rad); // back, counterclockwise
    const auto forward_m = static_cast<float>(static_cast<double>(one.x_m) * cos - static_cast<double>(one.y_m) * sin);
    const auto left_m = static_cast<float>(static_cast<double>(one.x_m) * sin + static_cast<double>(one.y_m) * cos);
    const double laser_deg = calibration_.storage[channel].azimuth_offset_rad * 180.0 / std::numbers::pi;
    const auto cloud = static_cast<long>(std::ceil((azimuth_deg_ + laser_deg - 1e-7) / 360.0)) - 1 + turns_;
    clouds_[cloud].push_back({-left_m, forward_m, one.z_m});
  }

  const Recorded& recorded_;
  const Calibration& calibration_;
  Decoder decoder_;
  LidarPacket packet_;
  std::map<long, std::vector<Point>> clouds_;
  double azimuth_deg_ = 0.0;
  long turns_ = 0;
  std::size_t sequence_ = 0;
};

double distance_m(const Point& a, const Point& b) {
  return std::hypot(static_cast<double>(a.x - b.x), static_cast<double>(a.y - b.y), static_cast<double>(a.z - b.z));
}

class HesaiReference : public testing::TestWithParam<Recorded> {};

TEST_P(HesaiReference, PointsMatchAnotherDecoder) {
  SKIP_WITHOUT(hesai_data(GetParam().folder));
  const auto calibration = read_calibration(hesai_data("calibration/" + GetParam().angles));
  ASSERT_TRUE(calibration) << calibration.error();
  const auto expected = test::read_binary_pcd<Point>(hesai_data(GetParam().folder + "/expected.pcd"));
  OtherDecoder decoder{GetParam(), *calibration};
  for (const auto& payload : packets_of(GetParam().folder))
    ASSERT_NO_FATAL_FAILURE(decoder.take(payload));
  // A revolution of the recording.
  const auto first_is_alike = [&](const auto& entry) {
    return entry.second.size() == expected.size() && distance_m(entry.second.front(), expected.front()) < 1e-3;
  };
  const auto cloud = std::ranges::find_if(decoder.clouds(), first_is_alike);
  ASSERT_NE(cloud, decoder.clouds().end());
  double farthest_m = 0.0;
  for (std::size_t i = 0; i < expected.size(); ++i)
    farthest_m = std::max(farthest_m, distance_m(cloud->second[i], expected[i]));
  EXPECT_LT(farthest_m, 1e-3);
  RecordProperty("farthest_mm", fmt::format("{:.4f}", 1e3 * farthest_m));
}

INSTANTIATE_TEST_SUITE_P(, HesaiReference,
                         testing::Values(Recorded{"40p", "Pandar40P.csv", Model::pandar40p, 600, 0.3},
                                         Recorded{"xt16", "PandarXT16.csv", Model::xt16, 600, 0.05},
                                         Recorded{"xt32", "PandarXT32.csv", Model::xt32, 600, 0.05},
                                         Recorded{"xt32m", "PandarXT32M.csv", Model::xt32m, 600, 0.5},
                                         Recorded{"qt128", "PandarQT128.csv", Model::qt128, 600, 0.3}),
                         testing::PrintToStringParamName());

/// Mean range difference of adjacent lasers of a QT128 on sloping walls, if each has turned by `share` of the rotation
/// until its firing. The two fire up to 76 us apart, 0.27 degrees, and are 2.5 degrees apart at most.
double mean_step_m(const std::vector<std::vector<std::byte>>& packets, const Calibration& calibration,
                   std::size_t sequence, double share) {
  constexpr double kColumnDeg = 0.8, kDegPerNs = 3.6e-6; // of packets of the same sequence, at 10 Hz
  const ModelSpec& its = spec(Model::qt128);
  const std::size_t block = its.layout.header + its.layout.block(); // the second
  std::vector<const std::byte*> columns;
  for (const auto& packet : packets)
    if ((std::to_integer<std::size_t>(packet[its.layout.body() + 4 + 17 + 5]) + 1) % 2 == sequence)
      columns.push_back(packet.data() + block + its.layout.block_header);
  const auto degrees = [](double angle_rad) { return angle_rad * 180.0 / std::numbers::pi; };
  double sum_m = 0.0;
  int steps = 0;
  for (std::size_t channel = 64; channel + 1 < its.layout.channels; ++channel) { // those that fire in both sequences
    const Laser &laser = calibration.storage[channel], &next = calibration.storage[channel + 1];
    const auto& firing_ns = its.sequences[sequence].offset_ns;
    const int apart_ns = firing_ns[channel] - firing_ns[channel + 1];
    const double offset_deg = degrees(laser.azimuth_offset_rad - next.azimuth_offset_rad);
    if (std::abs(degrees(laser.elevation_rad - next.elevation_rad)) > 2.5 || std::abs(offset_deg) > 0.5 ||
        std::abs(apart_ns) < 15'000)
      continue;
    const auto range_m = [&](std::ptrdiff_t column, std::size_t of) {
      const std::byte* const at = columns[static_cast<std::size_t>(column)] + of * its.layout.channel;
      return 0.004 * read_u16(at) * std::cos(calibration.storage[of].elevation_rad);
    };
    const double shift = (share * kDegPerNs * apart_ns + offset_deg) / kColumnDeg;
    const auto whole = static_cast<std::ptrdiff_t>(std::floor(shift));
    for (std::ptrdiff_t column = 2; column + 3 < static_cast<std::ptrdiff_t>(columns.size()); ++column) {
      const double one_m = range_m(column, channel), before_m = range_m(column - 1, channel + 1);
      const double low_m = range_m(column + whole, channel + 1), high_m = range_m(column + whole + 1, channel + 1);
      const double slope_m = high_m - low_m;
      if (std::min({one_m, before_m, low_m, high_m}) < 0.3 || std::abs(slope_m) < 0.015 || std::abs(slope_m) > 0.1)
        continue;
      if (const double step_m = std::abs(one_m - low_m - slope_m * (shift - static_cast<double>(whole)));
          step_m < 0.06) {
        sum_m += step_m;
        ++steps;
      }
    }
  }
  EXPECT_GT(steps, 1000);
  return sum_m / steps;
}

/// The azimuth is that of the block, and the lasers fire later, by the table of their sequence: adjacent lasers agree
/// better on walls than with no rotation, the opposite one, or twice as much.
TEST(HesaiFirings, OfAQt128AgreeBetweenNeighbouringLasers) {
  SKIP_WITHOUT(hesai_data("qt128"));
  const auto calibration = read_calibration(hesai_data("calibration/PandarQT128.csv"));
  ASSERT_TRUE(calibration) << calibration.error();
  const auto packets = packets_of("qt128");
  for (const std::size_t sequence : {0U, 1U}) {
    const double as_said_m = mean_step_m(packets, *calibration, sequence, 1.0);
    for (const double share : {-1.0, 0.0, 2.0})
      EXPECT_LT(as_said_m, mean_step_m(packets, *calibration, sequence, share)) << sequence << ' ' << share;
  }
}

} // namespace
} // namespace locus::hesai
