// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "support/clouds.hpp"

namespace locus::test {

/// The content of a PCD file with the fields and points of a cloud, padding left out, in each encoding.
std::string pcd_as_text(const OwnCloud& cloud);
std::string pcd_as_binary(const OwnCloud& cloud);
std::string pcd_compressed(const OwnCloud& cloud);

/// Packed by LZF: runs of one byte refer back, all else is copied.
std::string packed_by_lzf(const std::string& bytes);

} // namespace locus::test
