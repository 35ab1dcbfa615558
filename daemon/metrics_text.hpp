// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <concepts>
#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "daemon/figures.hpp"

namespace locus::daemon {

/// Builds the text of all metrics in OpenMetrics 1.0. The samples of a family follow its header; a family without
/// samples is omitted. The name of a family must outlive it. One owner.
class MetricsText {
 public:
  /// Label values need no escaping: configured names consist of letters, digits, _ and -.
  using Labels = std::initializer_list<std::pair<std::string_view, std::string_view>>;

  /// Begin a family of this type, without its suffix in `name`.
  void counter(std::string_view name, std::string_view help) { begin(name, "counter", "_total", help); }
  void gauge(std::string_view name, std::string_view help) { begin(name, "gauge", "", help); }
  void info(std::string_view name, std::string_view help) { begin(name, "info", "_info", help); }
  void state_set(std::string_view name, std::string_view help) { begin(name, "stateset", "", help); }
  void histogram(std::string_view name, std::string_view help) { begin(name, "histogram", "", help); }

  /// Add a sample to the family.
  void add(Labels labels, auto value) { sample(suffix_, labels, "", "", number(value)); }
  void add(auto value) { add({}, value); }
  void add_info(Labels labels) { add(labels, 1); }
  void add_state(Labels labels, std::string_view state, bool is_it) {
    sample("", labels, name_, state, is_it ? "1" : "0");
  }
  void add_buckets(const LatencyHistogram& histogram);

  /// Returns the text; nothing can be added after it.
  std::string finish() { return std::move(text_) + "# EOF\n"; }

 private:
  static std::string number(std::integral auto value) { return fmt::format("{}", value); }
  static std::string number(double value);

  void begin(std::string_view name, std::string_view type, std::string_view suffix, std::string_view help);
  /// Appends a sample; `last` is an additional label unless it is empty.
  void sample(std::string_view suffix, Labels labels, std::string_view last, std::string_view last_text,
              const std::string& value);

  std::string text_, head_;
  std::string_view name_, suffix_;
};

} // namespace locus::daemon
