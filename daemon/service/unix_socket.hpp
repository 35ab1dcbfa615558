// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

namespace locus::daemon {

/// Removes the file of a Unix socket of this type (SOCK_STREAM, ...) that a service which crashed has left: nobody
/// listens there. Whatever else has the name stays, and stands in the way of bind().
void remove_if_left_behind(const std::filesystem::path& socket, int type);

/// After accept() of a socket that does not wait: somebody called and could not be taken (no more descriptors, no
/// memory), so the socket stays ready and is not to be polled at once.
bool accept_has_failed();

} // namespace locus::daemon
