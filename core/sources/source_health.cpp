// SPDX-License-Identifier: Apache-2.0
#include "core/sources/source_health.hpp"

namespace locus {

std::string_view explanation(HealthReason reason) {
  switch (reason) {
  case HealthReason::stale:
    return "is silent, or its samples arrive in bursts, or more than 0.1 s after they were measured (check its driver, "
           "the network and the clock of its stamps)";
  case HealthReason::jump:
    return "claims a motion that no robot can make (check its units, its stamps and whether it was reset)";
  case HealthReason::nan:
    return "sends values that are not numbers, or too large for any sensor (check its driver)";
  case HealthReason::frozen:
    return "repeats one reading while the robot moves (restart its driver)";
  case HealthReason::out_of_order:
    return "sends stamps that repeat, go back or jump (check its clock and how its driver stamps)";
  case HealthReason::covariance:
    return "reports a covariance of its twist more than four times as large as usual (check the sensor, or what "
           "its driver fills in)";
  case HealthReason::disagreement:
    return "and lidar disagree on how the robot moves; it is not used until they agree (possible causes: its slip, "
           "scale or stamps, an IMU whose stamps are late, or lidar that follows moving objects around the robot)";
  case HealthReason::outside:
    return "is reported as unhealthy on its health_topic (ask the monitor that publishes it)";
  case HealthReason::self_check:
    return "did not pass its self-check (check its units, its stamps and T_base_source)";
  case HealthReason::speed:
    return kTooFast;
  case HealthReason::no_rotation:
    return "sends orientations that are no rotation: quaternions of zeros, or not of unit length (let its driver "
           "fill in all of x, y, z and w)";
  }
  return {};
}

} // namespace locus
