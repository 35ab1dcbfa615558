// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/page.hpp"

#include <string>
#include <string_view>

#include "locus_replay/output_file.hpp"

// The page as page/ was built into it, by page.S.
extern "C" {
extern const char locus_experiments_page_begin[];
extern const char locus_experiments_page_end[];
}

namespace locus::experiments {
namespace {

/// JSON that nothing in it can end the script element around it.
std::string for_script_element(const nlohmann::ordered_json& json) {
  std::string text = json.dump(-1, ' ', true, nlohmann::ordered_json::error_handler_t::replace);
  for (std::size_t at = text.find('<'); at != std::string::npos; at = text.find('<', at))
    text.replace(at, 1, "\\u003c");
  return text;
}

} // namespace

void write_page(const std::filesystem::path& path, const nlohmann::ordered_json& results) {
  constexpr std::string_view kPlace = "@RESULTS@";
  const std::string_view page{locus_experiments_page_begin, locus_experiments_page_end};
  const std::size_t place = page.find(kPlace);
  tools::OutputFile file(path);
  file.print("{}{}{}", page.substr(0, place), for_script_element(results), page.substr(place + kPlace.size()));
  file.close();
}

} // namespace locus::experiments
