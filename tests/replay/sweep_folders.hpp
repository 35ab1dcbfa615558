// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "replay_run.hpp"
#include "support/errors.hpp"

/// Support for tests of folders with one file per sweep.
namespace locus::test {

inline void write_with_folders(const std::filesystem::path& file, const std::string& text) {
  std::filesystem::create_directories(file.parent_path());
  std::ofstream{file, std::ios::binary} << text;
}

/// Expects rejection with one line that has all of these parts.
inline void expect_refused(const std::filesystem::path& capture, const std::vector<std::string>& said) {
  const ProgramRun run = Replay({capture}).run();
  EXPECT_EQ(run.status, 1) << run.err;
  EXPECT_EQ(lines_of(run.err).size(), 1U) << run.err;
  for (const std::string& part : said)
    EXPECT_TRUE(contains(run.err, part)) << "no '" << part << "' in: " << run.err;
}

inline std::string bytes_of_floats(const std::vector<float>& numbers) {
  return {reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(float)};
}

} // namespace locus::test
