// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <vector>

namespace locus::test {

/// A strict parser of metrics.
struct OpenMetrics {
  using Labels = std::map<std::string, std::string>;

  std::map<std::string, std::string> types;                ///< by family
  std::map<std::string, std::map<Labels, double>> samples; ///< by name, then by labels
  std::vector<std::string> mistakes;                       ///< violations of OpenMetrics 1.0; empty if there are none

  static OpenMetrics parse(const std::string& text);

  /// NaN and a failed test if it does not exist.
  [[nodiscard]] double value(const std::string& name, const Labels& labels = {}) const;
};

} // namespace locus::test
