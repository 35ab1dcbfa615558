// SPDX-License-Identifier: Apache-2.0
#include "accepted_traces.hpp"

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <optional>

#include <fmt/format.h>
#include <gtest/gtest.h>

namespace locus::test {
namespace {

constexpr const char* kAccept = "if that is meant: tests/golden/accept.sh (README.md beside it)";

bool accepts() {
  return std::getenv("LOCUS_ACCEPT_TRACES") != nullptr; // NOLINT(concurrency-mt-unsafe): nobody sets it meanwhile
}

std::optional<Trace> accepted_trace(const std::string& name) {
  std::ifstream stream{trace_file(name)};
  return Trace::parse({std::istreambuf_iterator<char>{stream}, {}});
}

void accept(const std::string& name, const std::optional<Trace>& before, const Trace& found) {
  const std::optional<std::string> changed = before ? difference(*before, found) : std::nullopt;
  fmt::print("{}: {}\n{}", name, !before ? "new" : changed ? "changed" : "as before", changed.value_or(""));
  std::filesystem::create_directories(trace_file(name).parent_path());
  std::ofstream stream{trace_file(name)};
  stream << found.text() << std::flush;
  EXPECT_TRUE(stream) << trace_file(name) << " cannot be written";
}

} // namespace

std::filesystem::path trace_file(const std::string& name) {
  return std::filesystem::path(LOCUS_TRACES) / (name + ".txt");
}

void expect_accepted(const std::string& name, const Trace& found, Isa isa) {
  const std::optional<Trace> accepted = accepted_trace(name);
  const bool exact = kGivesTheBitsOfTraces && isa == kIsaOfTraces;
  if (accepts() && exact)
    return accept(name, accepted, found);
  if (!accepted) {
    ADD_FAILURE() << name << ": " << trace_file(name) << " is no accepted trace; " << kAccept;
    return;
  }
  const std::optional<std::string> differs =
      exact ? difference(*accepted, found) : difference_beyond(Tolerance{}, *accepted, found);
  if (differs)
    ADD_FAILURE() << name << ", " << to_string(isa) << ": its estimates are not those accepted\n"
                  << *differs << "  " << kAccept;
}

} // namespace locus::test
