// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <malloc.h>

namespace locus::performance {

/// Returns the memory allocated by the process in MB. Any thread.
inline double held_mb() {
  const struct mallinfo2 held = mallinfo2();
  return 1e-6 * static_cast<double>(held.uordblks + held.hblkhd);
}

} // namespace locus::performance
