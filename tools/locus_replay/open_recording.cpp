// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/open_recording.hpp"

#include <filesystem>
#include <optional>
#include <utility>

#include "locus_replay/failure.hpp"
#include "locus_replay/find_recording.hpp"
#include "locus_replay/recorded_input.hpp"
#include "locus_replay/replay_config.hpp"

namespace locus::tools {

ChosenRecording choose_recording(Arguments& arguments) {
  FoundRecording found = find_recording(arguments.capture);
  arguments.capture = found.capture;
  const std::filesystem::path config_file = arguments.config.empty() ? found.files.first_config() : arguments.config;
  ChosenRecording chosen;
  if (!found.line.empty())
    chosen.lines.push_back(found.line);
  FoundMetadata metadata;
  chosen.config = configuration_for(found, config_file, arguments, chosen.lines, chosen.reasons, metadata);
  chosen.config_is_users_own = !config_file.empty();
  if (!metadata.used.empty()) {
    chosen.lines.push_back(metadata.used);
    chosen.reasons.of_key["lidars.0.metadata"] = metadata.used;
    chosen.reasons.of_key["lidars.0.port"] = "where the packets of the Ouster go";
  }
  chosen.warnings = std::move(metadata.warnings);
  if (const auto changed = arguments.config.empty() ? found.files.changed_config() : std::nullopt)
    chosen.warnings.push_back(*changed);
  chosen.files = std::move(found.files);
  return chosen;
}

OpenRecording open_recording(const Arguments& arguments, ChosenRecording& chosen, std::vector<Duration> earlier) {
  const Config& config = chosen.config;
  check_faults(arguments.faults, config);
  LidarRouter lidars = value_or_fail(LidarRouter::open(config.lidars), ExitStatus::wrong_usage);
  RecordedInput input = open_input(arguments, chosen.files, config, chosen.config_is_users_own, chosen.warnings);
  if (!input.used.empty())
    chosen.lines.push_back(input.used);
  const PlayOptions options{arguments.start, arguments.duration, arguments.faults, config.sweep.seed,
                            std::move(earlier)};
  auto recording =
      std::make_unique<Recording>(std::move(input.lidars), std::move(input.motion), config, lidars, options);
  return {std::move(lidars), std::move(recording), std::move(input.truth)};
}

} // namespace locus::tools
