// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

namespace locus::tools {

/// Accepts numbers from `low` to `high`, inclusive. CLI11's own ranges accept NaN.
inline CLI::Validator number_between(double low, double high) {
  return {[=](const std::string& text) {
            double number = 0;
            const bool within = CLI::detail::lexical_cast(text, number) && number >= low && number <= high;
            return within ? std::string{} : fmt::format("{} is not a number from {} to {}", text, low, high);
          },
          ""};
}

} // namespace locus::tools
