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

/// How the frames of a robot lie to each other, as /tf_static has it. One owner.
class StaticTransforms {
 public:
  /// Takes all transforms of a tf2_msgs/TFMessage, but those that are no finite poses.
  void take(MessageReader reader);

  /// T_to_from; nothing where no transforms lead from one frame to the other.
  [[nodiscard]] std::optional<Pose> between(std::string_view to, std::string_view from) const;

 private:
  struct Parent {
    std::string frame;
    Pose T_parent_child;
  };
  template <class Visit> void climb(std::string_view frame, Visit visit) const;

  std::map<std::string, Parent, std::less<>> parents_; ///< by the child's name
};

} // namespace locus::tools
