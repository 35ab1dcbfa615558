// SPDX-License-Identifier: Apache-2.0
#include "daemon/dds/ros_graph.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <string>

namespace locus::daemon {
namespace {

TEST(RosNode, HasTheNamespaceOfItsTopics) {
  EXPECT_EQ(ros_node("/locus", "").name_space, "/");
  EXPECT_EQ(ros_node("/robot_7/locus", "").name_space, "/robot_7");
  EXPECT_EQ(ros_node("/site/robot_7/locus", "").name_space, "/site/robot_7");
  EXPECT_EQ(ros_node("", "").name_space, "/");
}

TEST(RosNode, HasTheNameOfTheServiceAndOfItsInstance) {
  EXPECT_EQ(ros_node("/locus", "").name, "locusd");
  EXPECT_EQ(ros_node("/locus", "left").name, "locusd_left");
  EXPECT_EQ(ros_node("/locus", "lidar_2").name, "locusd_lidar_2");
  EXPECT_EQ(ros_node("/locus", "left-arm").name, "locusd_left_x2darm");
}

/// systemd allows letters, digits and :-_.\ in the name of an instance.
TEST(RosNode, NameOfEachInstanceIsUniqueAndValid) {
  std::set<std::string> names;
  std::size_t count = 0;
  for (const char* instance : {"a-b", "a_b", "a.b", "a:b", "a\\x2db", "a_x2db", "a_x5fx2db", "a__x2db", "a_-b", "a-_b",
                               "a_", "a_x", "7", "_x2d", "-", "_", "\xff", "x"}) {
    const std::string name = ros_node("/locus", instance).name;
    EXPECT_TRUE(std::ranges::all_of(name, [](char c) {
      return c == '_' || (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z');
    })) << name;
    names.insert(name);
    ++count;
  }
  EXPECT_EQ(names.size(), count);
}

} // namespace
} // namespace locus::daemon
