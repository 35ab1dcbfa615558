// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "config/config_proposal.hpp"
#include "core/base/source_id.hpp"
#include "locus_replay/bag_survey.hpp"

namespace locus::tools {

/// Mountings of a configuration that the user has not set, or only in part.
struct UnsetMountings {
  struct Parts {
    bool rotation = false, translation = false; ///< true: not set

    [[nodiscard]] bool any() const { return rotation || translation; }
    [[nodiscard]] bool all() const { return rotation && translation; }
  };
  std::vector<Parts> lidars, sources; ///< by index; sensors beyond the end are set

  /// Finds those which neither the file (empty: none) nor the assignments set. `config` is that before the assignments,
  /// which override_config() accepts.
  static UnsetMountings in(const Config& config, const std::filesystem::path& file,
                           std::span<const std::string> assignments);
};

/// Mounts the lidars and IMUs of a bag as /tf_static places the frames of their messages on the base, except what the
/// user has set. If that does not place the first lidar, its frame is the base. `has_file`: motion sources that do not
/// use the bag. Reports the mountings in `lines` for the user, and in `reasons`. Throws Failure as BagTopics::choose()
/// does.
void mount_by_transforms(const BagSurvey& survey, const std::string& bag_name, const UnsetMountings& unset,
                         const std::function<bool(SourceId)>& has_file, Config& config, std::vector<std::string>& lines,
                         ConfigReasons& reasons);

} // namespace locus::tools
