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

/// Faults of the service and of its computer.
enum class DayFault : std::uint8_t {
  clock_step,      ///< the wall clock is stepped
  process_stop,    ///< the process is stopped (SIGSTOP)
  thread_hang,     ///< one of its threads is stopped
  crash,           ///< SIGKILL; systemd restarts it
  lidar_lost,      ///< no packet
  imu_lost,        ///< no sample
  odometry_lost,   ///< no sample
  link_down,       ///< the network interface of DDS
  garbage,         ///< datagrams of random length and content on the lidar ports
  flood,           ///< garbage at the maximum rate
  duplicates,      ///< packets that arrive twice
  late,            ///< packets that are overtaken by others
  disk_full,       ///< the file system of state and recording is full
  reload,          ///< with the same configuration
  broken_config,   ///< reload while the file is truncated
  second_odometry, ///< another publisher on the same topic
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
  Duration begin{}, lasts{}; ///< simulated time since the start of the day; instantaneous faults last zero
  Duration step{};           ///< step of the clock
  std::string thread;        ///< thread that is stopped

  [[nodiscard]] Duration end() const { return begin + lasts; }
};

std::string to_text(const ScheduledFault& fault);

/// Schedules the faults of a day in order of their beginnings: a Poisson process of `mean_pause`, all kinds equally
/// likely. Faults of different kinds may overlap, those of one kind do not. The first and last half minute are free of
/// faults. Equal arguments give equal faults.
std::vector<ScheduledFault> schedule_faults(std::uint64_t seed, Duration day, Duration mean_pause);

} // namespace locus::test
