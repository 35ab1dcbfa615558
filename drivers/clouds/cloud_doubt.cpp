// SPDX-License-Identifier: Apache-2.0
#include "drivers/clouds/cloud_doubt.hpp"

#include <fmt/format.h>

namespace locus {

namespace {

/// Describes the substitute for missing point times.
std::string_view fallback(PointTiming timing) {
  return timing == PointTiming::azimuth ? "their times are computed from their azimuths"
                                        : "they count as measured at one instant, so the motion of the robot "
                                          "distorts them";
}

} // namespace

std::string explain(CloudDoubt doubt, PointTiming timing) {
  switch (doubt) {
  case CloudDoubt::no_times:
    return fmt::format("its points have no field of times (time, t, timestamp, time_stamp, offset_time), so {}; have "
                       "the lidar's driver publish points with times",
                       fallback(timing));
  case CloudDoubt::equal_times:
    return fmt::format("its points all have the same time, so {}; have the lidar's driver publish the times of points, "
                       "not those of packets or clouds",
                       fallback(timing));
  case CloudDoubt::disorder:
    return fmt::format(
        "the times of its points are not monotonic along a ring, so {}; use the topic of the driver, not "
        "of a filter",
        fallback(timing));
  case CloudDoubt::no_unit:
    return fmt::format("the times of its points do not span a revolution of a lidar in s, ms, us or ns (0.5 to 250 ms, "
                       "at least an eighth of the period), so {}; check the unit of the driver, and whether its "
                       "clouds are single revolutions",
                       fallback(timing));
  case CloudDoubt::stamp_at_end:
    return "its clouds arrive before their last point by their stamps: the header's stamp is used as that of the "
           "last point, not of the first; set the driver to stamp the first point";
  case CloudDoubt::tai:
    return "its stamps are 37 s ahead of this computer's clock: they are TAI, as of PTP, not UTC, so their time of "
           "arrival is used; configure the offset to UTC (37 s) in ptp4l and phc2sys";
  case CloudDoubt::ahead:
    return "its stamps are in the future by this computer's clock, so their time of arrival is used; synchronise the "
           "lidar's clock with it (PTP), or have the driver stamp by the computer's clock";
  case CloudDoubt::two_frames:
    return "some of its clouds are of another frame, so of another lidar, and are rejected; give each lidar a topic of "
           "its own";
  case CloudDoubt::behind:
    return "its stamps are of another clock than this computer's, so their time of arrival is used; synchronise the "
           "lidar's clock with it (PTP), or have the driver stamp by the computer's clock";
  case CloudDoubt::backwards:
    return "the stamps of its clouds go back or stand still from one to the next, and what is older than the sweep is "
           "left out; have the driver stamp each cloud by one clock that nobody sets, let no second driver publish on "
           "the topic, and sort a merged bag by time";
  }
  return "";
}

} // namespace locus
