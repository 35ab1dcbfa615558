// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "drivers/clouds/cloud_view.hpp"
#include "liblocus/liblocus.hpp"

namespace locus::library {

/// The arrays of a cloud as the records of a message, the form that its way through the daemon begins with. One owner.
class CloudRecords {
 public:
  /// The message, valid until the next call. Precondition: check_lengths() finds nothing.
  const CloudView& make(const liblocus::Cloud& cloud);

 private:
  std::vector<std::byte> bytes_;
  CloudView view_;
};

std::size_t points_of(const liblocus::Cloud& cloud);

/// Throws liblocus::Error for an array that is not as long as the others ask for.
void check_lengths(const liblocus::Cloud& cloud);

} // namespace locus::library
