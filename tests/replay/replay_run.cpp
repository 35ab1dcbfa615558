// SPDX-License-Identifier: Apache-2.0
#include "replay_run.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <sstream>
#include <stdexcept>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

namespace locus::test {
namespace {

std::vector<std::string> split(const std::string& text, char separator) {
  std::istringstream stream{text};
  std::vector<std::string> parts;
  for (std::string part; std::getline(stream, part, separator);)
    parts.push_back(part);
  return parts;
}

/// "1700000000.000000001" keeps its last digit, which a double would lose.
Stamp stamp_from_text(const std::string& seconds) {
  const std::vector<std::string> parts = split(seconds, '.');
  return stamp_from_ns(std::stoll(parts.at(0)) * 1'000'000'000 + std::stoll(parts.at(1)));
}

Eigen::Vector3d position_at(const std::vector<StampedPose>& truth, Stamp stamp) {
  const auto after = std::ranges::lower_bound(truth, stamp, {}, &StampedPose::stamp);
  if (after == truth.begin() || after == truth.end())
    return (after == truth.end() ? truth.back() : truth.front()).pose.translation;
  const auto before = std::prev(after);
  const double fraction = to_seconds(stamp - before->stamp) / to_seconds(after->stamp - before->stamp);
  return interpolate(before->pose, after->pose, fraction).translation;
}

} // namespace

TemporaryFolder::TemporaryFolder() {
  std::string name = testing::TempDir() + "/locus-replay-XXXXXX";
  if (::mkdtemp(name.data()) == nullptr)
    throw std::runtime_error("no temporary folder " + name);
  path_ = name;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

std::string read_text(const std::filesystem::path& file) {
  std::ifstream stream{file, std::ios::binary};
  return {std::istreambuf_iterator<char>{stream}, {}};
}

std::vector<std::string> lines_of(const std::string& text) { return split(text, '\n'); }

std::vector<StampedPose> read_tum(const std::filesystem::path& file) {
  std::vector<StampedPose> poses;
  for (const std::string& line : lines_of(read_text(file))) {
    const std::vector<std::string> fields = split(line, ' ');
    const auto number = [&](std::size_t i) { return std::stod(fields.at(i)); };
    poses.push_back({stamp_from_text(fields.at(0)),
                     {{number(7), number(4), number(5), number(6)}, {number(1), number(2), number(3)}}});
  }
  return poses;
}

ProgramRun run_program(const std::string& program, const std::vector<std::string>& arguments) {
  const TemporaryFolder folder;
  std::vector<std::string> command{program};
  command.insert(command.end(), arguments.begin(), arguments.end());
  const std::string out = folder / "out", err = folder / "err";
  std::vector<char*> argv;
  for (std::string& word : command)
    argv.push_back(word.data());
  argv.push_back(nullptr);

  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, out.c_str(), O_WRONLY | O_CREAT, 0600);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, err.c_str(), O_WRONLY | O_CREAT, 0600);
  pid_t child = 0;
  int status = -1;
  if (posix_spawn(&child, program.c_str(), &actions, nullptr, argv.data(), environ) == 0)
    waitpid(child, &status, 0);
  posix_spawn_file_actions_destroy(&actions);
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, read_text(out), read_text(err)};
}

Replay::Replay(std::vector<std::string> arguments) {
  arguments.insert(arguments.end(), {"-o", folder_.path().string()});
  run_ = run_program(LOCUS_REPLAY, arguments);
}

std::vector<std::vector<std::string>> Replay::table() const {
  std::vector<std::vector<std::string>> rows;
  for (const std::string& line : lines_of(read_text(file("odometry.csv"))))
    rows.push_back(split(line, ','));
  return rows;
}

TrajectoryError trajectory_error(const std::vector<StampedPose>& trajectory, const std::vector<StampedPose>& truth) {
  const auto count = static_cast<Eigen::Index>(trajectory.size());
  Eigen::Matrix3Xd estimated(3, count), expected(3, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const StampedPose& row = trajectory[static_cast<std::size_t>(i)];
    estimated.col(i) = row.pose.translation;
    expected.col(i) = position_at(truth, row.stamp);
  }
  const Eigen::Matrix4d T = Eigen::umeyama(estimated, expected, false);
  const Eigen::Matrix3Xd aligned = (T.topLeftCorner<3, 3>() * estimated).colwise() + T.topRightCorner<3, 1>();
  const Eigen::VectorXd distance = (aligned - expected).colwise().norm();
  return {std::sqrt(distance.squaredNorm() / static_cast<double>(count)), distance.maxCoeff()};
}

} // namespace locus::test
