// SPDX-License-Identifier: Apache-2.0
// library_run replay|packets RECORDING: replays by liblocus, or feeds the packets of a capture to it, in one thread.
#include <cstdio>
#include <string_view>

#include "core/base/stamp.hpp"
#include "drivers/files/capture.hpp"
#include "liblocus.hpp"

namespace {

double replayed_m(const char* recording) {
  liblocus::Replay replay(recording, {.overrides = {"threads=1"}});
  double x_m = 0;
  while (const auto estimate = replay.next())
    x_m = estimate->position_m[0];
  return x_m;
}

double fed_m(const char* file) {
  auto capture = locus::Capture::open(file);
  if (!capture)
    throw liblocus::Error(capture.error());
  liblocus::Odometry odometry({}, {"threads=1", "motion_sources=[]"});
  double x_m = 0;
  const auto add = [&](const std::vector<liblocus::Estimate>& estimates) {
    if (!estimates.empty())
      x_m = estimates.back().position_m[0];
  };
  while (const locus::Datagram* const datagram = capture->next())
    add(odometry.packet(datagram->payload, locus::to_ns(datagram->receive_stamp), datagram->destination_port,
                        datagram->source_ip));
  add(odometry.finish());
  return x_m;
}

} // namespace

int main(int argc, char** argv) {
  if (argc != 3)
    return 2;
  std::printf("%.6f\n", std::string_view{argv[1]} == "replay" ? replayed_m(argv[2]) : fed_m(argv[2]));
}
