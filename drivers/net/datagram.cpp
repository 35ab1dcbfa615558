// SPDX-License-Identifier: Apache-2.0
#include "drivers/net/datagram.hpp"

#include <fmt/format.h>

namespace locus {

std::string dotted(std::uint32_t ip) {
  return fmt::format("{}.{}.{}.{}", ip >> 24U, ip >> 16U & 0xFFU, ip >> 8U & 0xFFU, ip & 0xFFU);
}

} // namespace locus
