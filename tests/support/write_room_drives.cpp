// SPDX-License-Identifier: Apache-2.0
// write_room_drives FOLDER: writes the drives around a room that the tests replay, once for all of them.
#include <chrono>
#include <filesystem>

#include "support/kitti_room.hpp"
#include "support/test_drives.hpp"

int main(int argc, char** argv) {
  using namespace std::chrono_literals;
  if (argc != 2)
    return 2;
  const std::filesystem::path folder = argv[1];
  locus::test::write_room_drive(folder / "room", 8s);
  locus::test::write_room_drive(folder / "long_room", 20s);
  locus::test::kitti_room::write_drive(folder / "kitti_room");
  return 0;
}
