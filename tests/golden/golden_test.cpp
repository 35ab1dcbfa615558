// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "accepted_traces.hpp"
#include "drives.hpp"
#include "locus_replay/replay_program.hpp"
#include "support/child.hpp"
#include "support/temporary_folder.hpp"
#include "support/test_data.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

std::vector<std::string> words_of(const std::string& options) {
  std::istringstream stream{options};
  return {std::istream_iterator<std::string>{stream}, {}};
}

/// Returns all estimates of locus-replay; nothing if it rejects the recording with an error.
std::optional<std::vector<OdometryEstimate>> replay(const std::filesystem::path& recording, const std::string& options,
                                                    Isa isa, int threads = 1) {
  const TemporaryFolder output;
  std::vector<std::string> words{"locus-replay", "--quiet", "--threads", std::to_string(threads)};
  std::ranges::copy(words_of(options), std::back_inserter(words));
  words.insert(words.end(), {"-o", output.path(), recording});
  std::vector<char*> argv;
  for (std::string& word : words)
    argv.push_back(word.data());
  setenv("LOCUS_ISA", std::string{to_string(isa)}.c_str(),
         1); // NOLINT(concurrency-mt-unsafe): no thread reads it meanwhile
  std::vector<OdometryEstimate> estimates;
  const int status = tools::replay_program(static_cast<int>(argv.size()), argv.data(), {},
                                           [&](const OdometryEstimate& estimate) { estimates.push_back(estimate); });
  return status == 0 ? std::optional(std::move(estimates)) : std::nullopt;
}

/// Returns the instruction sets of this processor, that of the traces first.
std::vector<Isa> isas(bool others_too) {
  std::vector<Isa> all;
  for (const Isa isa : {kIsaOfTraces, Isa::baseline, Isa::avx512}) {
    if (is_supported(isa) && (isa == kIsaOfTraces || others_too))
      all.push_back(isa);
  }
  if (all.empty())
    fmt::print("a drive is not compared: this processor lacks {}\n", to_string(kIsaOfTraces));
  return all;
}

class Golden : public testing::TestWithParam<SimulatedCourse> {};

TEST_P(Golden, DrivesGiveTheAcceptedEstimates) {
  const SimulatedCourse& course = GetParam();
  const TemporaryFolder folder;
  std::vector<std::string> command{LOCUS_SIM, "-o", folder.path()};
  std::ranges::copy(words_of(course.options), std::back_inserter(command));
  Child sim(command);
  ASSERT_EQ(sim.wait_for_exit(std::chrono::minutes{5}), 0) << testing::PrintToString(sim.lines());
  const std::string checksum = checksum_of(folder.path());
  std::filesystem::remove(folder / "gt_map.ply"); // accuracy is not tested here
  std::filesystem::remove(folder / "gt.tum");
  for (const Drive& drive : course.drives) {
    const std::string name = course.name + '/' + drive.name;
    const std::string options = fmt::format("locus-sim {}; locus-replay {}", course.options, drive.options);
    for (const Isa isa : isas(drive.on_other_isas_too)) {
      const auto estimates = replay(folder.path(), drive.options, isa);
      ASSERT_TRUE(estimates) << name;
      expect_accepted(name, Trace::of(options, checksum, *estimates), isa);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Simulated, Golden, testing::ValuesIn(kCourses),
                         [](const auto& course) { return course.param.name; });

class GoldenRecording : public testing::TestWithParam<RealRecording> {};

TEST_P(GoldenRecording, GivesTheAcceptedEstimates) {
  const RealRecording& recording = GetParam();
  const std::filesystem::path path = test_data() / recording.path;
  const std::string name = "real/" + recording.name;
  if (!std::filesystem::exists(path))
    GTEST_SKIP() << path << " is not there; set LOCUS_TEST_DATA";
  for (const Isa isa : isas(recording.on_other_isas_too)) {
    const auto estimates = replay(path, "", isa);
    if (!estimates && !std::filesystem::exists(trace_file(name)))
      GTEST_SKIP() << path << ": locus-replay does not read it, and never has: see above";
    ASSERT_TRUE(estimates) << name << ": locus-replay has read it before";
    expect_accepted(name, Trace::of(recording.path, checksum_of(path), *estimates), isa);
  }
}

INSTANTIATE_TEST_SUITE_P(Real, GoldenRecording, testing::ValuesIn(kRecordings),
                         [](const auto& recording) { return recording.param.name; });

TEST(GoldenTraces, BelongToADrive) {
  std::set<std::filesystem::path> files;
  for (const SimulatedCourse& course : kCourses) {
    for (const Drive& drive : course.drives)
      files.insert(trace_file(course.name + '/' + drive.name));
  }
  for (const RealRecording& recording : kRecordings)
    files.insert(trace_file("real/" + recording.name));
  for (const auto& entry : std::filesystem::recursive_directory_iterator{LOCUS_TRACES}) {
    EXPECT_TRUE(entry.is_directory() || files.contains(entry.path()))
        << entry.path() << " is the trace of no drive in drives.hpp; remove it";
  }
}

TEST(GoldenTraces, DoNotDependOnTheNumberOfThreads) {
  const auto bits = [](int threads) {
    return Trace::of("", "", replay(plant_drive(), "", isas(true).front(), threads).value()).estimates;
  };
  EXPECT_EQ(bits(1), bits(2));
}

} // namespace
} // namespace locus::test
