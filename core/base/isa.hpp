// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "core/base/names.hpp"

namespace locus {

/// Instruction sets that the hot kernels are built for. Results are bit-identical within one set, not between sets.
enum class Isa : std::uint8_t { baseline, avx2, avx512 };

/// Values of the environment variable LOCUS_ISA.
constexpr auto names_of(Isa) { return std::to_array<std::string_view>({"baseline", "avx2", "avx512"}); }

/// Returns the best set that this processor supports.
Isa best_isa();

/// Returns whether this processor supports `isa`.
bool is_supported(Isa isa);

#if defined(__x86_64__)
template <class Body> [[gnu::flatten, gnu::target("avx2,fma")]] void run_as_avx2(const Body& body) { body(); }
template <class Body>
[[gnu::flatten, gnu::target("avx512f,avx512vl,avx512dq,fma")]] void run_as_avx512(const Body& body) {
  body();
}
#endif

/// Runs `body` compiled for an instruction set that the processor supports: one source, compiled for each set. Only
/// inlined code is affected, so no type changes its layout; a body is a loop or two over plain arrays.
template <class Body> void run_as(Isa isa, const Body& body) {
#if defined(__x86_64__)
  if (isa == Isa::avx512)
    return run_as_avx512(body);
  if (isa == Isa::avx2)
    return run_as_avx2(body);
#endif
  static_cast<void>(isa);
  body();
}

} // namespace locus
