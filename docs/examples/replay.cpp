// SPDX-License-Identifier: Apache-2.0
// Prints the trajectory of the robot in TUM format (t x y z qx qy qz qw), and the size of the map.
//   g++ -std=c++20 replay.cpp -o replay $(pkg-config --cflags --libs liblocus) && ./replay drive.pcap
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include <liblocus.hpp>

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fputs("usage: replay RECORDING\n", stderr);
    return 2;
  }
  try {
    liblocus::Replay replay(argv[1]);
    double sigma_m = 0;
    while (const auto estimate = replay.next()) {
      const auto [seconds, ns] = std::lldiv(estimate->stamp_ns, 1'000'000'000);
      std::printf("%lld.%09lld", seconds, ns);
      for (const double metres : estimate->position_m)
        std::printf(" %.6f", metres);
      for (const double number : estimate->orientation_xyzw)
        std::printf(" %.6f", number);
      std::puts("");
      sigma_m = std::sqrt(estimate->pose_covariance[0] + estimate->pose_covariance[7]);
    }
    std::fprintf(stderr, "%zu surfaces, 1 sigma %.3f m\n", replay.map().size(), sigma_m);
    for (const std::string& warning : replay.warnings())
      std::fprintf(stderr, "warning: %s\n", warning.c_str());
  } catch (const liblocus::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
