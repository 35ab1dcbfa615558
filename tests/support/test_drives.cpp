// SPDX-License-Identifier: Apache-2.0
#include "support/test_drives.hpp"

namespace locus::test {

std::filesystem::path room_drive() { return LOCUS_TEST_DRIVES "/room"; }
std::filesystem::path long_room_drive() { return LOCUS_TEST_DRIVES "/long_room"; }
std::filesystem::path plant_drive() { return LOCUS_TEST_DRIVES "/plant"; }
std::filesystem::path mine_drive() { return LOCUS_TEST_DRIVES "/mine"; }
std::filesystem::path walking_drive() { return LOCUS_TEST_DRIVES "/walking"; }
std::filesystem::path kitti_room_drive() { return LOCUS_TEST_DRIVES "/kitti_room/2023_11_14_drive_0001_extract"; }

} // namespace locus::test
