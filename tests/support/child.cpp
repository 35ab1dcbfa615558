// SPDX-License-Identifier: Apache-2.0
#include "support/child.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <stdexcept>
#include <utility>

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

namespace locus::test {
namespace {

struct Pipe {
  int read_end = -1, write_end = -1;
  Pipe() {
    std::array<int, 2> ends{};
    if (pipe2(ends.data(), O_CLOEXEC) != 0)
      throw std::runtime_error("no pipe");
    read_end = ends[0];
    write_end = ends[1];
  }
};

} // namespace

Child::Child(std::vector<std::string> command) {
  const Pipe input, output;
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, input.read_end, STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, output.write_end, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, output.write_end, STDERR_FILENO);
  std::vector<char*> arguments;
  for (std::string& word : command)
    arguments.push_back(word.data());
  arguments.push_back(nullptr);
  const int error = posix_spawn(&pid_, arguments[0], &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  close(input.read_end);
  close(output.write_end);
  if (error != 0)
    throw std::runtime_error("cannot start " + command.front());
  stdin_ = input.write_end;
  reader_ = std::thread([this, descriptor = output.read_end] { read_lines(descriptor); });
}

Child::~Child() {
  if (!status_)
    kill(pid_, SIGKILL);
  wait_for_exit(std::chrono::seconds{10});
  close_stdin();
  reader_.join();
}

void Child::close_stdin() {
  if (const int descriptor = std::exchange(stdin_, -1); descriptor >= 0)
    close(descriptor);
}

void Child::signal(int number) const { kill(pid_, number); }

std::optional<int> Child::wait_for_exit(Duration timeout) {
  const auto give_up = std::chrono::steady_clock::now() + timeout;
  while (!status_) {
    int status = 0;
    if (waitpid(pid_, &status, WNOHANG) == pid_)
      status_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    else if (std::chrono::steady_clock::now() > give_up)
      break;
    else
      std::this_thread::sleep_for(std::chrono::milliseconds{2});
  }
  if (status_) { // its last output may still be in the pipe; a grandchild may hold the pipe open for longer
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, std::chrono::seconds{5}, [&] { return all_read_; });
  }
  return status_;
}

void Child::read_lines(int descriptor) {
  std::string rest;
  std::array<char, 4096> buffer{};
  for (ssize_t count = 0; (count = read(descriptor, buffer.data(), buffer.size())) > 0 || errno == EINTR;) {
    rest.append(buffer.data(), static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
    if (count == 0)
      break;
    const std::scoped_lock lock(mutex_);
    for (std::size_t end = 0; (end = rest.find('\n')) != std::string::npos; rest.erase(0, end + 1))
      lines_.push_back(rest.substr(0, end));
    changed_.notify_all();
  }
  close(descriptor);
  const std::scoped_lock lock(mutex_);
  all_read_ = true;
  changed_.notify_all();
}

std::vector<std::string> Child::lines() const {
  const std::scoped_lock lock(mutex_);
  return lines_;
}

std::vector<std::string> Child::lines_of(const std::string& word) const {
  std::vector<std::string> found;
  for (const std::string& line : lines())
    if (line.starts_with(word + ' '))
      found.push_back(line.substr(word.size() + 1));
  return found;
}

bool Child::has_line(const std::string& part) const {
  return std::ranges::any_of(lines(), [&](const std::string& line) { return line.find(part) != std::string::npos; });
}

bool Child::wait_until(const std::function<bool(const std::vector<std::string>&)>& holds) const {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, patience(), [&] { return holds(lines_); });
}

bool Child::wait_for_line(const std::string& part) const {
  return wait_until([&](const std::vector<std::string>& lines) {
    return std::ranges::any_of(lines, [&](const std::string& line) { return line.find(part) != std::string::npos; });
  });
}

} // namespace locus::test
