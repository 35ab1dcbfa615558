// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

namespace locus::test {

/// Where the real captures lie. May not exist: a test that needs them skips with a message.
std::filesystem::path test_data();

} // namespace locus::test
