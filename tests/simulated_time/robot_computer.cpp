// SPDX-License-Identifier: Apache-2.0
#include "simulated_time/robot_computer.hpp"

#include <array>
#include <cstdlib>
#include <stdexcept>
#include <thread>

#include <fcntl.h>
#include <fmt/format.h>
#include <sched.h>
#include <sys/mount.h>
#include <unistd.h>

namespace locus::test {
namespace {

void require(bool done, const char* what) {
  if (!done)
    throw std::runtime_error(fmt::format("{} is not allowed; run as root", what));
}

void run(const std::string& command) {
  if (std::system(command.c_str()) != 0) // NOLINT(concurrency-mt-unsafe, cert-env33-c)
    throw std::runtime_error("failed: " + command);
}

/// Static neighbour entries on both sides: ARP uses kernel timers in system time, on which senders would wait.
constexpr const char* kHereMac = "02:00:00:00:00:01";
constexpr const char* kThereMac = "02:00:00:00:00:02";

int this_network() { return open("/proc/thread-self/ns/net", O_RDONLY | O_CLOEXEC); }

} // namespace

RobotComputer::RobotComputer() {
  require(unshare(CLONE_NEWNET) == 0, "a network namespace of one's own");
  there_ = this_network(); // NOLINT(cppcoreguidelines-prefer-member-initializer): not before
  run("ip link set lo up");
  require(unshare(CLONE_NEWNET | CLONE_NEWNS) == 0, "a network namespace of one's own");
  here_ = this_network(); // NOLINT(cppcoreguidelines-prefer-member-initializer): not before
  run("ip link set lo up");
  run(fmt::format("ip link add dds0 address {} type veth peer name dds0 address {} netns /proc/{}/fd/{}", kHereMac,
                  kThereMac, getpid(), there_));
  run("ip addr add 10.9.1.1/24 dev dds0");
  set_link(true);
  over_there([] {
    run("ip addr add 10.9.1.2/24 dev dds0");
    run("ip link set dds0 up");
    run(fmt::format("ip neigh replace 10.9.1.1 lladdr {} nud permanent dev dds0", kHereMac));
  });
  require(mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0, "a file system of one's own");
  std::filesystem::create_directory(state());
  require(mount("tmpfs", state().c_str(), "tmpfs", 0, "size=48m") == 0, "a file system of one's own");
}

RobotComputer::~RobotComputer() {
  umount2(state().c_str(), MNT_DETACH);
  close(here_);
  close(there_);
}

void RobotComputer::over_there(const std::function<void()>& run) const {
  std::exception_ptr problem;
  std::thread([&] {
    try {
      require(setns(there_, CLONE_NEWNET) == 0, "to enter a network namespace");
      run();
    } catch (...) {
      problem = std::current_exception();
    }
  }).join();
  if (problem)
    std::rethrow_exception(problem);
}

std::vector<std::string> RobotComputer::there(std::vector<std::string> command) const {
  const std::string network = fmt::format("--net=/proc/{}/fd/{}", getpid(), there_);
  command.insert(command.begin(), {"/usr/bin/nsenter", network});
  return command;
}

void RobotComputer::set_link(bool up) const {
  run(fmt::format("ip link set dds0 {}", up ? "up" : "down"));
  if (up)
    run(fmt::format("ip neigh replace 10.9.1.2 lladdr {} nud permanent dev dds0", kThereMac));
}

void RobotComputer::set_disk_full(bool full) const {
  const std::filesystem::path ballast = state() / "ballast";
  std::error_code ignored;
  std::filesystem::remove(ballast, ignored);
  if (!full)
    return;
  const int file = open(ballast.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0644);
  static const std::array<char, 65536> kNothing{};
  for (std::size_t block = kNothing.size(); block > 0;)
    if (write(file, kNothing.data(), block) <= 0)
      block /= 2;
  close(file);
}

} // namespace locus::test
