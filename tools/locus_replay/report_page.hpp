// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

namespace locus::tools {

/// The page of the report as it was built from report/, cut where the run belongs: a script element that holds JSON.
struct ReportPage {
  std::string_view before_run;
  std::string_view after_run;
};
ReportPage report_page();

} // namespace locus::tools
