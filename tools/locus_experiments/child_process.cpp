// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/child_process.hpp"

#include <cerrno>
#include <csignal>
#include <fstream>
#include <set>
#include <system_error>

#include <fcntl.h>
#include <fmt/format.h>
#include <sched.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

namespace locus::experiments {
namespace {

/// The programs that run.
struct Children {
  std::mutex mutex;
  std::set<pid_t> running;
};
Children& children() {
  static Children all;
  return all;
}

cpu_set_t affinity() {
  cpu_set_t set;
  CPU_ZERO(&set);
  sched_getaffinity(0, sizeof(set), &set);
  return set;
}

/// While it lives, what this thread starts runs on these processors alone.
class PinnedThread {
 public:
  explicit PinnedThread(const std::vector<int>& cpus) : before_(affinity()) {
    if (cpus.empty())
      return;
    cpu_set_t set;
    CPU_ZERO(&set);
    for (const int cpu : cpus)
      CPU_SET(static_cast<std::size_t>(cpu), &set);
    sched_setaffinity(0, sizeof(set), &set);
  }
  ~PinnedThread() { sched_setaffinity(0, sizeof(before_), &before_); }
  PinnedThread(const PinnedThread&) = delete;
  PinnedThread& operator=(const PinnedThread&) = delete;

 private:
  cpu_set_t before_;
};

int spawn(const std::vector<std::string>& command, const std::filesystem::path& log, pid_t& child) {
  std::vector<char*> argv;
  argv.reserve(command.size() + 1);
  for (const std::string& word : command)
    argv.push_back(const_cast<char*>(word.c_str())); // NOLINT(cppcoreguidelines-pro-type-const-cast): not written to
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
  posix_spawnattr_t attributes; // signals that this program waits for are to reach the other one
  sigset_t none;
  sigemptyset(&none);
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
  const int error = posix_spawn(&child, command.front().c_str(), &actions, &attributes, argv.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  return error;
}

std::string last_line_of(const std::filesystem::path& file) {
  std::ifstream stream{file};
  std::string last;
  for (std::string line; std::getline(stream, line);) {
    if (!line.empty())
      last = line;
  }
  return last;
}

} // namespace

std::vector<int> usable_cpus() {
  const cpu_set_t set = affinity();
  std::vector<int> cpus;
  for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu) {
    if (CPU_ISSET(static_cast<std::size_t>(cpu), &set))
      cpus.push_back(cpu);
  }
  return cpus;
}

std::optional<std::string> run_program(const std::vector<std::string>& command, const std::filesystem::path& log,
                                       const std::vector<int>& cpus) {
  pid_t child = 0;
  {
    const std::lock_guard lock(children().mutex);
    const PinnedThread pinned(cpus);
    if (const int error = spawn(command, log, child))
      return fmt::format("{}: cannot be started ({})", command.front(), std::generic_category().message(error));
    children().running.insert(child);
  }
  siginfo_t ignored{};
  while (waitid(P_PID, static_cast<id_t>(child), &ignored, WEXITED | WNOWAIT) < 0 && errno == EINTR) {
  }
  const std::lock_guard lock(children().mutex);
  children().running.erase(child);
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0)
    return std::nullopt;
  if (WIFSIGNALED(status))
    return fmt::format("{}: ended by signal {}", command.front(), WTERMSIG(status));
  const std::string said = last_line_of(log);
  return said.empty() ? fmt::format("{}: failed without a word", command.front()) : said;
}

std::unique_lock<std::mutex> end_programs() {
  std::unique_lock lock(children().mutex);
  for (const pid_t child : children().running) {
    siginfo_t ignored{};
    kill(child, SIGTERM);
    waitid(P_PID, static_cast<id_t>(child), &ignored, WEXITED | WNOWAIT); // its starter takes note of the end
  }
  return lock;
}

} // namespace locus::experiments
