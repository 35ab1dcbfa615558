// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "core/base/isa.hpp"
#include "trace.hpp"

namespace locus::test {

/// The instruction set that the traces are of.
inline constexpr Isa kIsaOfTraces = Isa::avx2;

/// Whether this build gives the bits of the traces: gcc's, of any level of optimisation, with and without assertions.
#if defined(__GNUC__) && !defined(__clang__)
inline constexpr bool kGivesTheBitsOfTraces = true;
#else
inline constexpr bool kGivesTheBitsOfTraces = false;
#endif

std::filesystem::path trace_file(const std::string& name);

/// Fails the test unless `found`, by this instruction set, is what was accepted: to the last bit by that of the traces,
/// else within the tolerance. Where the environment variable LOCUS_ACCEPT_TRACES is set it accepts it instead, and says
/// what has changed.
void expect_accepted(const std::string& name, const Trace& found, Isa isa);

} // namespace locus::test
