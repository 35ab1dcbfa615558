// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <vector>

namespace locus::test {

/// Metrics as a reader who forgives nothing takes them.
struct OpenMetrics {
  using Labels = std::map<std::string, std::string>;

  std::map<std::string, std::string> types;                ///< by family
  std::map<std::string, std::map<Labels, double>> samples; ///< by name, then by labels
  std::vector<std::string> mistakes;                       ///< against OpenMetrics 1.0; empty: there are none

  static OpenMetrics parse(const std::string& text);

  /// NaN, and a failed test, if there is none.
  [[nodiscard]] double value(const std::string& name, const Labels& labels = {}) const;
};

} // namespace locus::test
