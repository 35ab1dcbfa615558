// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "daemon/metrics_text.hpp"

namespace locus::daemon {

/// Adds process metrics under the standard names of the Prometheus client libraries.
void add_process(MetricsText& text);

} // namespace locus::daemon
