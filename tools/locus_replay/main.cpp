// SPDX-License-Identifier: Apache-2.0
// locus-replay: odometry, map and figures from a recorded capture.
#include "locus_replay/replay_program.hpp"

int main(int argc, char** argv) { return locus::tools::replay_program(argc, argv); }
