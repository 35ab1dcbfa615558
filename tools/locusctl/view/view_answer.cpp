// SPDX-License-Identifier: Apache-2.0
#include "locusctl/view/view_answer.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <optional>
#include <system_error>

#include "daemon/http_server.hpp"

namespace locus::tools {
namespace {

/// The page is self-contained, as its own policy says, and requests only from where it came; no other site may embed or
/// read it.
constexpr std::string_view kSecurityFields =
    "Content-Security-Policy: default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src data:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'\r\n"
    "Cross-Origin-Resource-Policy: same-origin\r\n"
    "X-Content-Type-Options: nosniff\r\n"
    "Referrer-Policy: no-referrer\r\n"
    "Cache-Control: no-store\r\n";

std::string error(std::string_view status, std::string_view why) {
  return daemon::http_error(status, why, kSecurityFields);
}

/// Tells whether a Host field names the loopback interface, with any port: a tunnel may have another one.
bool is_loopback(std::string_view host) {
  if (const std::size_t colon = host.rfind(':'); colon != std::string_view::npos && !host.ends_with(']'))
    host = host.substr(0, colon);
  std::string name{host};
  std::ranges::transform(name, name.begin(), [](unsigned char letter) { return std::tolower(letter); });
  return name == "127.0.0.1" || name == "localhost" || name == "[::1]";
}

/// Reads a number from epoch=1&tiles=2; zero if it is missing or malformed.
template <class Number> Number number_in(std::string_view query, std::string_view key) {
  while (!query.empty()) {
    const std::string_view pair = query.substr(0, query.find('&'));
    query.remove_prefix(std::min(query.size(), pair.size() + 1));
    if (pair.substr(0, pair.find('=')) != key || pair.size() == key.size())
      continue;
    Number number{};
    const char* const end = pair.data() + pair.size();
    const auto [stopped, failure] = std::from_chars(pair.data() + key.size() + 1, end, number);
    return failure == std::errc{} && stopped == end ? number : Number{};
  }
  return {};
}

} // namespace

std::string view_answer(std::string_view request, std::string_view page, const LiveView& view) {
  const auto head = daemon::HttpRequest::parse(request);
  if (!head)
    return error("400 Bad Request", "Send GET / HTTP/1.1 and a head of at most 16 kB.");
  if (const auto host = head->field("Host"); !host || !is_loopback(*host))
    return error("403 Forbidden", "Open this page by the name 127.0.0.1 or localhost.");
  if (head->method != "GET")
    return daemon::http_error("405 Method Not Allowed", "The only method is GET.",
                              std::string{kSecurityFields} + "Allow: GET\r\n");
  if (head->path == "/")
    return daemon::http_response("200 OK", "text/html; charset=utf-8", kSecurityFields, page);
  if (head->path != "/live")
    return error("404 Not Found", "The only resources are / and /live.");
  const std::string_view query = head->query;
  return daemon::http_response(
      "200 OK", "application/octet-stream", kSecurityFields,
      view.answer({number_in<std::int64_t>(query, "epoch"), number_in<std::size_t>(query, "tiles"),
                   number_in<std::size_t>(query, "positions"), number_in<std::uint64_t>(query, "sequence")}));
}

} // namespace locus::tools
