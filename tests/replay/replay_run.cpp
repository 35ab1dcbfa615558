// SPDX-License-Identifier: Apache-2.0
#include "replay_run.hpp"

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <sstream>

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

} // namespace

std::string read_text(const std::filesystem::path& file) {
  std::ifstream stream{file, std::ios::binary};
  return {std::istreambuf_iterator<char>{stream}, {}};
}

std::vector<std::string> lines_of(const std::string& text) { return split(text, '\n'); }

std::vector<StampedPose> read_tum(const std::filesystem::path& file) {
  const auto trajectory = read_trajectory(file);
  EXPECT_TRUE(trajectory) << trajectory.error();
  return trajectory ? *trajectory : std::vector<StampedPose>{};
}

void write_scaled_tum(const std::filesystem::path& from, double factor, const std::filesystem::path& to) {
  std::ofstream file(to);
  for (StampedPose pose : read_tum(from)) {
    pose.T_source_base.translation *= factor;
    file << to_line(pose);
  }
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

} // namespace locus::test
