// SPDX-License-Identifier: Apache-2.0
#include "pages/data_page.hpp"

#include <cassert>
#include <cstddef>
#include <string>

#include "locus_replay/output_file.hpp"

namespace locus::tools {
namespace {

/// Escapes JSON so that it cannot end the script element: "<" occurs only in strings, where its code may replace it.
std::string for_html(const nlohmann::ordered_json& json) {
  const std::string text = json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
  std::string safe;
  safe.reserve(text.size());
  for (const char character : text) {
    if (character == '<')
      safe += "\\u003c";
    else
      safe += character;
  }
  return safe;
}

} // namespace

void write_data_page(const std::filesystem::path& path, std::string_view page, const nlohmann::ordered_json& data) {
  constexpr std::string_view kPlace = "@DATA@";
  const std::size_t place = page.find(kPlace);
  assert(place != std::string_view::npos);
  OutputFile file(path);
  file.print("{}{}{}", page.substr(0, place), for_html(data), page.substr(place + kPlace.size()));
  file.close();
}

} // namespace locus::tools
