// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "core/base/isa.hpp"
#include "trace.hpp"

namespace locus::test {

/// Instruction set of the accepted traces.
inline constexpr Isa kIsaOfTraces = Isa::avx2;

/// True if this build reproduces the traces' bits: gcc's, at any optimisation level, with and without assertions.
#if defined(__GNUC__) && !defined(__clang__)
inline constexpr bool kGivesTheBitsOfTraces = true;
#else
inline constexpr bool kGivesTheBitsOfTraces = false;
#endif

std::filesystem::path trace_file(const std::string& name);

/// Fails the test unless `found`, computed by this instruction set, equals the accepted trace: bit by bit for the
/// traces' instruction set, else within the tolerance. If the environment variable LOCUS_ACCEPT_TRACES is set, accepts
/// `found` instead and prints the changes.
void expect_accepted(const std::string& name, const Trace& found, Isa isa);

} // namespace locus::test
