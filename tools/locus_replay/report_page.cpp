// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/report_page.hpp"

#include <cassert>
#include <cstddef>

// Laid into the program by report_page.S.
extern "C" const char locus_report_page_begin[]; // NOLINT(modernize-avoid-c-arrays): its length is the linker's affair
extern "C" const char locus_report_page_end[];   // NOLINT(modernize-avoid-c-arrays)

namespace locus::tools {

ReportPage report_page() {
  constexpr std::string_view kPlace = "@RUN@";
  const std::string_view page{locus_report_page_begin, locus_report_page_end};
  const std::size_t place = page.find(kPlace);
  assert(place != std::string_view::npos);
  return {page.substr(0, place), page.substr(place + kPlace.size())};
}

} // namespace locus::tools
