// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "locus_sim/hesai_packet.hpp"

namespace locus::test {

using HesaiTestPacket = sim::HesaiPacket;

} // namespace locus::test
