// SPDX-License-Identifier: Apache-2.0
#include "daemon/ingest.hpp"

#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/allocation_counter.hpp"
#include "daemon/drive.hpp"

namespace locus::daemon {
namespace {

/// All properties of a sweep except its points.
struct Summary {
  std::uint64_t sequence;
  Stamp start, end;
  std::size_t raw_returns, points;
  Eigen::Vector3f first_point;

  bool operator==(const Summary&) const = default;
};

template <class Feed> std::vector<Summary> sweeps_of(const Config& config, const Feed& feed) {
  std::vector<Summary> sweeps;
  Ingest ingest(config, open_lidars(config), [&](Sweep& sweep, const SweepCut&) {
    const Eigen::Vector3f first =
        sweep.points.empty() ? Eigen::Vector3f::Zero().eval() : sweep.points.front().position_base_m;
    sweeps.push_back({sweep.sequence, sweep.start, sweep.end, sweep.raw_returns, sweep.points.size(), first});
  });
  for (const Input& input : Drive::instance().inputs())
    feed(ingest, input);
  ingest.process(EndOfInput{});
  return sweeps;
}

bool is_datagram(const Input& input) { return std::holds_alternative<Datagram>(input); }

TEST(Ingest, BuildsOneSweepPerRevolutionAndCountsEveryPacket) {
  const Config config = Drive::config();
  std::size_t sweeps = 0;
  Ingest ingest(config, open_lidars(config), [&](Sweep& sweep, const SweepCut& cut) {
    ++sweeps;
    EXPECT_GT(sweep.points.size(), 1000U);
    EXPECT_GT(cut.start.wall, Duration::zero());
    EXPECT_EQ(sweep.uncorrected, sweeps == 1 ? sweep.uncorrected : Uncorrected::nothing);
  });
  std::uint64_t datagrams = 0;
  for (const Input& input : Drive::instance().inputs()) {
    datagrams += is_datagram(input) ? 1U : 0U;
    ingest.process(input);
  }
  ingest.process(EndOfInput{});
  EXPECT_NEAR(static_cast<double>(sweeps), Drive::kSweeps, 1);
  EXPECT_EQ(ingest.lidars().total().received, datagrams);
  EXPECT_EQ(ingest.lidars().total().data, datagrams);
  EXPECT_GT(ingest.stages().total(Stage::decode), Duration::zero());
  EXPECT_GT(ingest.stages().total(Stage::correct), Duration::zero());
}

TEST(Ingest, SilenceBetweenInputsChangesNoSweep) {
  const auto alone = sweeps_of(Drive::config(), [](Ingest& ingest, const Input& input) { ingest.process(input); });
  const auto with_silence = sweeps_of(Drive::config(), [](Ingest& ingest, const Input& input) {
    ingest.process(Silence{arrival_of(input, {})});
    ingest.process(input);
  });
  ASSERT_FALSE(alone.empty());
  EXPECT_EQ(alone, with_silence);
}

TEST(Ingest, WindowsWithoutLidarAreSweeps) {
  const Stamp dies = arrival_of(Drive::instance().inputs().front(), {}) + std::chrono::seconds{2};
  const auto sweeps = sweeps_of(Drive::config(), [&](Ingest& ingest, const Input& input) {
    if (!is_datagram(input) || arrival_of(input, {}) < dies)
      ingest.process(input);
  });
  ASSERT_NEAR(static_cast<double>(sweeps.size()), Drive::kSweeps, 2);
  EXPECT_GT(sweeps[10].raw_returns, 10'000U);
  EXPECT_EQ(sweeps.back().raw_returns, 0U);
}

struct Filters {
  std::string name;
  Config config;
};

class IngestWithFilters : public testing::TestWithParam<Filters> {};

TEST_P(IngestWithFilters, AllocatesNothingOnceWarm) {
  if (!allocations())
    GTEST_SKIP() << "a sanitizer is in the way of counting";
  constexpr std::uint64_t kWarm = 10;
  const Config& config = GetParam().config;
  std::vector<SweepPoint> spare;
  spare.reserve(Ingest::max_points(config));
  std::optional<std::uint64_t> before;
  std::optional<std::uint64_t> after;
  Ingest ingest(config, open_lidars(config), [&](Sweep& sweep, const SweepCut&) {
    std::swap(sweep.points, spare);
    spare.reserve(Ingest::max_points(config));
    (sweep.sequence <= kWarm ? before : after) = allocations();
  });
  for (const Input& input : Drive::instance().inputs())
    ingest.process(input);
  ASSERT_TRUE(before && after);
  EXPECT_EQ(*after - *before, 0U);
}

Filters segments() { return {"Segments", Drive::config()}; }
Filters as_in_the_paper() {
  Filters filters{"AsInThePaper", Drive::config()};
  filters.config.sweep.segment_filter.enabled = false;
  filters.config.sweep.voxel_filter.enabled = true;
  filters.config.sweep.random_filter.enabled = true;
  return filters;
}

INSTANTIATE_TEST_SUITE_P(All, IngestWithFilters, testing::Values(segments(), as_in_the_paper()),
                         [](const auto& instance) { return instance.param.name; });

} // namespace
} // namespace locus::daemon
