// SPDX-License-Identifier: Apache-2.0
#include "support/test_data.hpp"

#include <cstdlib>

namespace locus::test {

std::filesystem::path test_data() {
  const char* from_environment = std::getenv("LOCUS_TEST_DATA"); // NOLINT(concurrency-mt-unsafe): nobody sets it
  return from_environment != nullptr ? from_environment : LOCUS_TEST_DATA;
}

} // namespace locus::test
