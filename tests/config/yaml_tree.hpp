// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>

namespace locus::test {

/// Returns every value of a YAML text by its dotted path, lists of scalars as one value: {"dds.domain": "0", "range_m":
/// "[0.5, 100]"}.
std::map<std::string, std::string> leaves_of(const std::string& yaml);

} // namespace locus::test
