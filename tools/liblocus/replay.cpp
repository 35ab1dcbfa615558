// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <iterator>
#include <utility>

#include <fmt/format.h>

#include "liblocus/engine.hpp"
#include "liblocus/liblocus.hpp"
#include "locus_replay/arguments.hpp"
#include "locus_replay/open_recording.hpp"
#include "locus_replay/verdicts.hpp"

namespace liblocus {

using namespace locus; // the implementation

namespace {

void check_time(std::string_view name, std::chrono::nanoseconds time, std::chrono::nanoseconds least) {
  if (time < least || to_seconds(time) > tools::kLongest_s)
    throw Error(
        fmt::format("{}: {} s is not within {} and {}", name, to_seconds(time), to_seconds(least), tools::kLongest_s));
}

tools::Arguments arguments_of(const std::filesystem::path& recording, const ReplayOptions& options) {
  check_time("start", options.start, {});
  if (options.duration)
    check_time("duration", *options.duration, std::chrono::milliseconds{1});
  tools::Arguments arguments;
  arguments.capture = recording;
  arguments.config = options.yaml_file;
  arguments.overrides = options.overrides;
  arguments.start = options.start;
  arguments.duration = options.duration;
  return arguments;
}

} // namespace

struct Replay::Implementation {
  tools::Arguments arguments;
  tools::ChosenRecording chosen = tools::choose_recording(arguments);
  tools::OpenRecording open = tools::open_recording(arguments, chosen);
  library::Engine engine{chosen.config, std::move(open.lidars)};
  bool over = false;

  explicit Implementation(tools::Arguments asked) : arguments(std::move(asked)) {}

  [[nodiscard]] daemon::Figures figures() const {
    daemon::Figures figures = engine.figures();
    figures.capture = arguments.capture.string();
    figures.duration = open.recording->duration();
    return figures;
  }
  [[nodiscard]] tools::PlayedRecording played(const daemon::Figures& figures) const {
    return {arguments.capture, engine.config(), *open.recording, engine.ingest(), figures};
  }

  void play_on() {
    const daemon::Input input = open.recording->next({});
    engine.process(input);
    over = std::holds_alternative<daemon::EndOfInput>(input);
    if (!over)
      return;
    const daemon::Figures all = figures();
    if (const std::optional<std::string> why = tools::why_no_result(played(all)))
      throw Error(*why);
  }
};

Replay::Replay(const std::filesystem::path& recording, const ReplayOptions& options) {
  library::in_words_of_the_library(
      [&] { implementation_ = std::make_unique<Implementation>(arguments_of(recording, options)); });
}

Replay::~Replay() = default;
Replay::Replay(Replay&& other) noexcept = default;
Replay& Replay::operator=(Replay&& other) noexcept = default;

std::optional<Estimate> Replay::next() {
  std::deque<Estimate>& completed = implementation_->engine.completed();
  while (completed.empty() && !implementation_->over)
    implementation_->play_on();
  if (completed.empty())
    return std::nullopt;
  Estimate estimate = std::move(completed.front());
  completed.pop_front();
  return estimate;
}

std::vector<std::string> Replay::warnings() const {
  std::vector<std::string> lines = implementation_->chosen.warnings;
  const auto add = [&](const std::vector<std::string>& more) { std::ranges::copy(more, std::back_inserter(lines)); };
  if (!implementation_->over)
    return lines;
  add(implementation_->open.recording->warnings());
  const daemon::Figures figures = implementation_->figures();
  add(tools::warnings_about(implementation_->played(figures)));
  return lines;
}

std::vector<Surface> Replay::scan() const { return implementation_->engine.scan(); }
std::vector<Surface> Replay::map() const { return implementation_->engine.map(); }
std::string Replay::figures_json() const { return library::to_json_text(implementation_->figures()); }

} // namespace liblocus
