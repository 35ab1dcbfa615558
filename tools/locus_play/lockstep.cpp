// SPDX-License-Identifier: Apache-2.0
#include "locus_play/lockstep.hpp"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <thread>

#include <fmt/format.h>

#include "locus_replay/failure.hpp"
#include "locusctl/service_client.hpp"

namespace locus::tools {

namespace {

using Json = nlohmann::ordered_json;

/// Interval between checks, shorter than a sweep at 20 Hz, the fastest rotation of a lidar.
constexpr Duration kPollInterval = std::chrono::milliseconds{40};
constexpr std::chrono::seconds kTimeout{60};

/// Polls without a delay of its own: the service limits the rate of requests.
template <class Holds> bool wait_until(const std::filesystem::path& socket, const Holds& holds) {
  const auto deadline = std::chrono::steady_clock::now() + kTimeout;
  while (!holds(send_request(socket, {{"command", "status"}}).json))
    if (std::chrono::steady_clock::now() > deadline)
      return false;
  return true;
}

} // namespace

void Lockstep::wait_for_writers(const std::vector<std::string>& sources) const {
  const auto is_known = [](const Json& status, const std::string& name) {
    const auto source = status["sources"].find(name);
    return source == status["sources"].end() || source->value("writers", 0) > 0;
  };
  if (!wait_until(socket_, [&](const Json& status) {
        return std::ranges::all_of(sources, [&](const std::string& name) { return is_known(status, name); });
      }))
    throw Failure(ExitStatus::failed,
                  fmt::format("{}: its service does not receive all of {}; check dds.interface and dds.domain",
                              socket_.string(), fmt::join(sources, ", ")));
}

void Lockstep::wait_until_processed(Stamp now) {
  if (checked_at_ != Stamp::min() && std::chrono::abs(now - checked_at_) < kPollInterval)
    return;
  checked_at_ = now;
  const auto has_processed_all = [](const Json& status) {
    const Json& sweeps = status["sweeps"];
    const auto count = [&](const char* what) { return sweeps[what].get<std::int64_t>(); };
    return count("seen") == count("processed") + count("failed") + count("dropped");
  };
  if (!wait_until(socket_, has_processed_all))
    throw Failure(ExitStatus::failed, fmt::format("{}: its service no longer processes sweeps", socket_.string()));
}

} // namespace locus::tools
