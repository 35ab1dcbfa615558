// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/pose.hpp"
#include "drivers/clouds/message_reader.hpp"

namespace locus::tools {

inline constexpr std::string_view kTransformsType = "tf2_msgs/TFMessage";
inline constexpr std::string_view kStaticTopic = "/tf_static";

/// Fixed transforms between the frames of a robot, from /tf_static. One owner.
class StaticTransforms {
 public:
  /// Adds all transforms of a tf2_msgs/TFMessage, except those that are not finite poses.
  void add(MessageReader reader);

  /// Returns T_to_from; nothing if no chain of transforms connects the frames.
  [[nodiscard]] std::optional<Pose> between(std::string_view to, std::string_view from) const;

 private:
  struct Parent {
    std::string frame;
    Pose T_parent_child;
  };
  template <class Visit> void climb(std::string_view frame, Visit visit) const;

  std::map<std::string, Parent, std::less<>> parents_; ///< by child frame
};

} // namespace locus::tools
