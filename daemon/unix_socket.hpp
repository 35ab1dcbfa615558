// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

namespace locus::daemon {

/// Removes the file of a Unix socket of this type (SOCK_STREAM, ...) without a listener, left by a crashed service. Any
/// other file of this name stays, and bind() fails.
void remove_if_left_behind(const std::filesystem::path& socket, int type);

/// Tells, after accept() of a non-blocking socket, whether a connection could not be accepted (out of descriptors or
/// memory). The socket then stays ready and must not be polled at once.
bool accept_has_failed();

} // namespace locus::daemon
