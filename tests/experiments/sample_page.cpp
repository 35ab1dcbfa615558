// SPDX-License-Identifier: Apache-2.0
// sample-page FOLDER: writes the page of made-up runs, whose results.json is in the folder, for the browser test.
#include <cstdlib>
#include <filesystem>

#include "locus_experiments/results.hpp"

int main(int argc, char** argv) {
  using namespace locus::experiments;
  if (argc != 2)
    return EXIT_FAILURE;
  const std::filesystem::path folder = argv[1];
  Results results = read_results(folder / "results.json");
  judge(results);
  write_results(folder, results);
  return EXIT_SUCCESS;
}
