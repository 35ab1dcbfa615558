// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "support/clouds.hpp"

namespace locus::test {

/// Returns a PCD file with the fields and points of a cloud in each encoding, without padding.
std::string pcd_as_text(const OwnCloud& cloud);
std::string pcd_as_binary(const OwnCloud& cloud);
std::string pcd_compressed(const OwnCloud& cloud);

/// Compresses by LZF: runs of one byte become back references, everything else is literal.
std::string packed_by_lzf(const std::string& bytes);

} // namespace locus::test
