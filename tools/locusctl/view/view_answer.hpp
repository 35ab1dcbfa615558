// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "locusctl/view/live_view.hpp"

namespace locus::tools {

/// Answers the head of a browser's request of arbitrary bytes: GET / by the page, and GET /live by LiveView::answer(),
/// with the members of Known as the query. A request under another name of the host than one of the loopback
/// interface is rejected, so that no web site can read the answers under its own name (DNS rebinding). Returns the
/// complete response. Any thread.
std::string view_answer(std::string_view request, std::string_view page, const LiveView& view);

} // namespace locus::tools
