// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "drivers/clouds/cloud_view.hpp"
#include "liblocus/liblocus.hpp"

namespace locus::library {

/// Converts the arrays of a cloud to the records of a message, the daemon's input format. One owner.
class CloudRecords {
 public:
  /// Returns the message, valid until the next call. Precondition: check_lengths() returned.
  const CloudView& make(const liblocus::Cloud& cloud);

 private:
  std::vector<std::byte> bytes_;
  CloudView view_;
};

std::size_t points_of(const liblocus::Cloud& cloud);

/// Throws liblocus::Error for an array whose length does not match the others.
void check_lengths(const liblocus::Cloud& cloud);

} // namespace locus::library
