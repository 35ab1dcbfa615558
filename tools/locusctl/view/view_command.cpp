// SPDX-License-Identifier: Apache-2.0
#include "locusctl/view/view_command.hpp"

#include <chrono>
#include <cstdio>
#include <cstring>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <poll.h>

#include "core/base/stamp.hpp"
#include "daemon/http_server.hpp"
#include "daemon/machine_time.hpp"
#include "locus_replay/failure.hpp"
#include "locusctl/service_client.hpp"
#include "locusctl/view/live_view.hpp"
#include "locusctl/view/view_answer.hpp"

// Embedded into the program by locus_page() in CMake.
extern "C" const char locus_view_page_begin[]; // NOLINT(modernize-avoid-c-arrays): set by the linker
extern "C" const char locus_view_page_end[];   // NOLINT(modernize-avoid-c-arrays)

namespace locus::tools {
namespace {

constexpr Duration kPeriod = std::chrono::milliseconds{60}; ///< receives every sweep at 10 Hz, most at 20 Hz
constexpr Duration kRetryDelay = std::chrono::milliseconds{500};

std::vector<SurfacePoint> read_points(const std::vector<std::byte>& bytes) {
  std::vector<SurfacePoint> points(bytes.size() / sizeof(SurfacePoint));
  if (!points.empty())
    std::memcpy(std::as_writable_bytes(std::span(points)).data(), bytes.data(), points.size() * sizeof(SurfacePoint));
  return points;
}

/// Receives from the service until that fails.
void follow(const std::filesystem::path& control, LiveView& view) {
  const ServiceConnection service(control);
  for (;; std::this_thread::sleep_for(kPeriod)) {
    ServiceAnswer answer = service.request({{"command", "view"}});
    const auto sweep = read_sweep(answer.json, answer.bytes);
    view.set_status(std::move(answer.json["status"]));
    if (sweep && view.add(*sweep))
      view.add_map(read_points(service.request({{"command", "save-map"}}).bytes));
  }
}

[[noreturn]] void follow_forever(const std::filesystem::path& control, LiveView& view) {
  for (std::string last;; std::this_thread::sleep_for(kRetryDelay)) {
    try {
      follow(control, view);
    } catch (const Failure& failure) { // the service may return
      view.set_problem(failure.what());
      if (last != failure.what())
        fmt::print(stderr, "locusctl: {}\n", failure.what());
      last = failure.what();
    }
  }
}

} // namespace

void view(const std::filesystem::path& control, std::uint16_t port) {
  const std::string address = fmt::format("127.0.0.1:{}", port);
  const std::string_view page{locus_view_page_begin, locus_view_page_end};
  LiveView view(std::chrono::duration_cast<std::chrono::milliseconds>(daemon::read_clock(CLOCK_REALTIME)).count());
  auto server =
      daemon::HttpServer::open(address, [&](std::string_view request) { return view_answer(request, page, view); });
  if (!server)
    throw Failure(ExitStatus::failed, fmt::format("{}: {}; choose another port with --port N", address,
                                                  std::generic_category().message(server.error())));
  fmt::print("http://{}/\nfrom another computer: ssh -L {}:{} ROBOT, then the same address there; Ctrl-C ends it\n",
             address, port, address);
  flush_standard_output();
  std::thread([&] { follow_forever(control, view); }).detach();
  for (;;) {
    std::vector<pollfd> wait;
    (*server)->add_to(wait);
    constexpr int kTick_ms = 1000; // disconnects clients beyond their patience
    poll(wait.data(), wait.size(), kTick_ms);
    constexpr Duration kPause = std::chrono::milliseconds{5}; // limits the cost of clients
    if ((*server)->serve())
      std::this_thread::sleep_for(kPause);
  }
}

} // namespace locus::tools
