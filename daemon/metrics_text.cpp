// SPDX-License-Identifier: Apache-2.0
#include "daemon/metrics_text.hpp"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>

namespace locus::daemon {

std::string MetricsText::number(double value) {
  if (std::isnan(value))
    return "NaN";
  if (std::isinf(value))
    return value > 0 ? "+Inf" : "-Inf";
  return fmt::format("{}", value);
}

void MetricsText::add_buckets(const LatencyHistogram& histogram) {
  std::uint64_t count = 0;
  for (std::size_t i = 0; i < histogram.counts.size(); ++i) {
    count += histogram.counts[i];
    const bool is_last = i == LatencyHistogram::kBounds_s.size();
    sample("_bucket", {}, "le", is_last ? "+Inf" : number(LatencyHistogram::kBounds_s[i]), number(count));
  }
  sample("_sum", {}, "", "", number(histogram.sum_s));
  sample("_count", {}, "", "", number(count));
}

void MetricsText::begin(std::string_view name, std::string_view type, std::string_view suffix, std::string_view help) {
  name_ = name;
  suffix_ = suffix;
  head_ = fmt::format("# TYPE {} {}\n", name, type);
  for (const std::string_view unit : {"seconds", "bytes", "meters", "radians", "hertz", "ratio"})
    if (type != "info" && name.ends_with(unit) && !name.ends_with("per_second"))
      head_ += fmt::format("# UNIT {} {}\n", name, unit);
  head_ += fmt::format("# HELP {} {}\n", name, help);
}

void MetricsText::sample(std::string_view suffix, Labels labels, std::string_view last, std::string_view last_text,
                         const std::string& value) {
  text_ += std::exchange(head_, {});
  text_ += name_;
  text_ += suffix;
  std::string inside;
  const auto append = [&](std::string_view label, std::string_view text) {
    fmt::format_to(std::back_inserter(inside), "{}{}=\"{}\"", inside.empty() ? "" : ",", label, text);
  };
  for (const auto& [label, text] : labels)
    append(label, text);
  if (!last.empty())
    append(last, last_text);
  if (!inside.empty())
    text_ += '{' + inside + '}';
  text_ += ' ' + value + '\n';
}

} // namespace locus::daemon
