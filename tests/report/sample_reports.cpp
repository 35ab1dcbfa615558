// SPDX-License-Identifier: Apache-2.0
// sample-reports FOLDER: writes reports of made-up runs for the browser test.
#include <cstdlib>
#include <filesystem>

#include "sample_run.hpp"

namespace {

/// Text that would break out of the page if it were not escaped.
constexpr const char* kHostile = "</script><script>window.broken_out = true</script><!--<b> \xff.pcap";

} // namespace

int main(int argc, char** argv) {
  using locus::test::SampleRun;
  if (argc != 2)
    return EXIT_FAILURE;
  const std::filesystem::path folder = argv[1];
  std::filesystem::create_directories(folder);

  SampleRun hour = SampleRun::of(std::chrono::hours{1}, "hour");
  locus::tools::write_report(folder / "hour.html", hour.report());

  SampleRun hostile = SampleRun::of(std::chrono::minutes{1}, kHostile);
  hostile.config.motion_sources.front().name = kHostile;
  hostile.summary["sources"][kHostile] = hostile.summary["sources"]["wio"];
  hostile.summary["sources"][kHostile]["verdict"] = "turns the other way";
  locus::tools::write_report(folder / "hostile.html", hostile.report());

  locus::tools::write_report(folder / "bare.html", SampleRun::bare().report());

  SampleRun clouds = SampleRun::bare();
  clouds.summary["packets"].erase("front");
  clouds.summary["packets"].erase("rear");
  clouds.summary["packets"]["total"]["received"] = 0;
  clouds.summary["lidars"] = {{"front",
                               {{"topic", "/points"},
                                {"clouds",
                                 {{"received", 152},
                                  {"used", 150},
                                  {"reordered", 0},
                                  {"clock_steps", 0},
                                  {"refused", {{"cut", 0}, {"fields", 2}}},
                                  {"points", 4'292'375},
                                  {"times", "field"},
                                  {"rings", "field"}}}}}};
  locus::tools::write_report(folder / "clouds.html", clouds.report());

  SampleRun nothing = SampleRun::bare();
  nothing.sweeps.clear();
  locus::tools::write_report(folder / "nothing.html", nothing.report());
  return EXIT_SUCCESS;
}
