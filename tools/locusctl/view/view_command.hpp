// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>

namespace locus::tools {

inline constexpr std::uint16_t kViewPort = 8042;

/// Serves the live view of a service at a port of 127.0.0.1, and prints its address. Never returns: ended by a signal.
/// Throws Failure if the port is in use.
[[noreturn]] void view(const std::filesystem::path& control, std::uint16_t port);

} // namespace locus::tools
