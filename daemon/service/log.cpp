// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/log.hpp"

#include <array>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <vector>

#include <fmt/format.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

#define SD_JOURNAL_SUPPRESS_LOCATION // the location passed by the caller is used
#include <systemd/sd-journal.h>

namespace locus::daemon {

namespace {

/// Tells whether stderr is the stream that systemd connected to the journal; a redirected stderr gets plain text. So
/// does one in a container that inherits the variable but not the journal, whose library then drops messages silently.
bool stderr_is_journal() {
  const char* const stream = std::getenv("JOURNAL_STREAM"); // NOLINT(concurrency-mt-unsafe): at start-up
  struct stat status {};
  return stream != nullptr && fstat(STDERR_FILENO, &status) == 0 &&
         fmt::format("{}:{}", status.st_dev, status.st_ino) == stream &&
         access("/run/systemd/journal/socket", W_OK) == 0;
}

} // namespace

Log::Log(Clock clock) : clock_(clock), to_journal_(stderr_is_journal()) {}

void Log::write(Severity severity, const std::string& message, Fields fields, const SourceLocation& where) {
  std::uint64_t suppressed = 0;
  if (!is_admitted(where, suppressed))
    return;
  if (suppressed > 0)
    emit(severity, fmt::format("{} ({} more like it were suppressed)", message, suppressed), fields, where);
  else
    emit(severity, message, fields, where);
}

bool Log::is_admitted(const SourceLocation& where, std::uint64_t& suppressed_before) {
  const std::scoped_lock lock(mutex_);
  const Duration now = clock_(CLOCK_MONOTONIC);
  Site& site = sites_[{where.file, where.line}];
  if (site.written == 0 || now - site.since > kInterval) {
    suppressed_before = site.suppressed;
    site = {now, 0, 0};
  }
  if (site.written == kBurst) {
    ++site.suppressed;
    return false;
  }
  ++site.written;
  return true;
}

void Log::emit(Severity severity, const std::string& message, Fields fields, const SourceLocation& where) const {
  if (!to_journal_) {
    static constexpr std::array<std::string_view, 7> kPrefixes{"", "", "", "error: ", "warning: ", "", ""};
    const std::string line = fmt::format("locusd: {}{}\n", kPrefixes[static_cast<std::size_t>(severity)], message);
    static_cast<void>(std::fputs(line.c_str(), stderr)); // a full log does not stop the service
    return;
  }
  std::vector<std::string> lines{fmt::format("MESSAGE={}", message),
                                 fmt::format("PRIORITY={}", static_cast<int>(severity)),
                                 fmt::format("CODE_FILE={}", where.file), fmt::format("CODE_LINE={}", where.line),
                                 fmt::format("CODE_FUNC={}", where.function)};
  for (const auto& [name, value] : fields)
    lines.push_back(fmt::format("{}={}", name, value));
  std::vector<iovec> vectors;
  vectors.reserve(lines.size());
  for (std::string& line : lines)
    vectors.push_back({line.data(), line.size()});
  sd_journal_sendv(vectors.data(), static_cast<int>(vectors.size()));
}

} // namespace locus::daemon
