// SPDX-License-Identifier: Apache-2.0
// locus-replay: a recorded capture in; odometry, map and figures out.
#include "locus_replay/replay_program.hpp"

int main(int argc, char** argv) { return locus::tools::replay_program(argc, argv); }
