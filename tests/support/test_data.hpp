// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

namespace locus::test {

/// Returns the folder of the real captures. It may not exist: a test that needs it skips with a message.
std::filesystem::path test_data();

} // namespace locus::test
