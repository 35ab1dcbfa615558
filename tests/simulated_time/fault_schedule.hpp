// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/names.hpp"
#include "core/base/stamp.hpp"

namespace locus::test {

/// What can befall the service and the computer that it runs on.
enum class DayFault : std::uint8_t {
  clock_step,      ///< the wall clock is set
  process_stop,    ///< the process does not run (SIGSTOP)
  thread_hang,     ///< one of its threads does not
  crash,           ///< SIGKILL; systemd starts it anew
  lidar_lost,      ///< not a packet
  imu_lost,        ///< not a sample
  odometry_lost,   ///< not a sample
  link_down,       ///< the network interface of DDS
  garbage,         ///< datagrams of any length and content on the ports of the lidar
  flood,           ///< as many as a sender who goes wild sends
  duplicates,      ///< packets that come twice
  late,            ///< packets that others overtake
  disk_full,       ///< the file system of state and recording
  reload,          ///< of the same configuration
  broken_config,   ///< reload while the file is cut short
  second_odometry, ///< another publisher of the same topic
  deaf_reader      ///< a reliable reader that does not read
};
constexpr auto names_of(DayFault) {
  return std::to_array<std::string_view>({"clock_step", "process_stop", "thread_hang", "crash", "lidar_lost",
                                          "imu_lost", "odometry_lost", "link_down", "garbage", "flood", "duplicates",
                                          "late", "disk_full", "reload", "broken_config", "second_odometry",
                                          "deaf_reader"});
}
inline constexpr std::size_t kDayFaults = names_of(DayFault{}).size();

struct ScheduledFault {
  DayFault kind{};
  Duration begin{}, lasts{}; ///< simulated time since the day began; those of an instant last for none
  Duration step{};           ///< of the clock
  std::string thread;        ///< that hangs

  [[nodiscard]] Duration end() const { return begin + lasts; }
};

std::string to_text(const ScheduledFault& fault);

/// The faults of a day in order of their beginnings: a Poisson process of `mean_pause`, each kind as likely. They may
/// overlap, two of a kind do not. The same arguments give the same faults. None begins in the first half minute, none
/// goes on in the last.
std::vector<ScheduledFault> schedule_faults(std::uint64_t seed, Duration day, Duration mean_pause);

} // namespace locus::test
