// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

namespace locus {

/// "192.168.1.201" of an address in host byte order.
std::string dotted(std::uint32_t ip);

} // namespace locus
