// SPDX-License-Identifier: Apache-2.0
#include "fetch/fetch.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <optional>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "drivers/hesai/calibration.hpp"
#include "fetch/tcp_client.hpp"

namespace locus::tools {
namespace {

using File = Expected<SensorFile, std::string>;

constexpr std::size_t kMostBytes = 1'000'000; ///< forty times the longest known metadata

/// Compares the size of an answer with the expected one; returns the problem, or nothing.
std::optional<std::string> problem_of_size(std::size_t came, std::size_t expected) {
  if (expected > kMostBytes)
    return fmt::format("announces {} bytes", expected);
  return came < expected ? std::optional{fmt::format("the answer ends after {} of {} bytes", came, expected)}
                         : std::nullopt;
}

File as_metadata(std::string text) {
  auto metadata = ouster::parse_metadata(text);
  return metadata ? File{SensorFile{std::move(text), *std::move(metadata)}} : "its metadata: " + metadata.error();
}

/// Relevant header fields of an HTTP response.
struct HttpHead {
  std::size_t bytes;
  int status;
  std::optional<std::size_t> content_bytes; ///< nothing: until the connection closes
  bool is_chunked;
};

template <class Number> std::optional<Number> leading_number(std::string_view text) {
  Number number{};
  text.remove_prefix(std::min(text.find_first_not_of(' '), text.size()));
  const bool is_one = std::from_chars(text.data(), text.data() + text.size(), number).ec == std::errc{};
  return is_one ? std::optional{number} : std::nullopt;
}

/// Returns nothing while the header is incomplete or if it is not HTTP.
std::optional<HttpHead> http_head(std::string_view answer) {
  constexpr std::string_view kVersion = "HTTP/1.x ", kEnd = "\r\n\r\n",
                             kLength = "\r\ncontent-length:", kChunked = "\r\ntransfer-encoding: chunked";
  const std::size_t end = answer.find(kEnd);
  const auto status = answer.starts_with("HTTP/1.") && end != std::string_view::npos
                          ? leading_number<int>(answer.substr(kVersion.size()))
                          : std::nullopt;
  if (!status)
    return std::nullopt;
  std::string lines{answer.substr(0, end)};
  std::ranges::transform(lines, lines.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  HttpHead head{end + kEnd.size(), *status, std::nullopt, lines.find(kChunked) != std::string::npos};
  if (const std::size_t length = lines.find(kLength); length != std::string::npos)
    head.content_bytes = leading_number<std::size_t>(std::string_view{lines}.substr(length + kLength.size()));
  return head;
}

/// Joins the chunks of a body: each follows its length, a hexadecimal number in a line of its own, and the last one is
/// empty. Returns nothing if they break off.
std::optional<std::string> joined(std::string_view chunks) {
  constexpr std::string_view kLineEnd = "\r\n";
  constexpr int kHexadecimal = 16;
  std::string body;
  for (;;) {
    std::size_t bytes = 0;
    const std::size_t line = chunks.find(kLineEnd);
    if (line == std::string_view::npos ||
        std::from_chars(chunks.data(), chunks.data() + line, bytes, kHexadecimal).ec != std::errc{})
      return std::nullopt;
    if (bytes == 0)
      return body;
    chunks.remove_prefix(line + kLineEnd.size());
    if (bytes > kMostBytes || chunks.size() < bytes + kLineEnd.size())
      return std::nullopt;
    body.append(chunks.substr(0, bytes));
    chunks.remove_prefix(bytes + kLineEnd.size());
  }
}

/// Requests the metadata of current firmware by HTTP. Version 1.0 asks for a response in one piece; one in chunks is
/// accepted all the same.
File ask_ouster_http(TcpClient& client) {
  if (auto problem = client.send("GET /api/v1/sensor/metadata HTTP/1.0\r\nHost: sensor\r\n"
                                 "Accept: application/json\r\n\r\n"))
    return *std::move(problem);
  const auto is_whole = [](std::string_view text) {
    const auto head = http_head(text);
    if (head && head->status == 200 && head->is_chunked)
      return joined(text.substr(head->bytes)).has_value();
    if (!head || (head->status == 200 && !head->content_bytes))
      return false;
    return head->status != 200 || *head->content_bytes > kMostBytes ||
           text.size() >= head->bytes + *head->content_bytes;
  };
  std::string answer;
  if (auto problem = client.receive(answer, kMostBytes, is_whole))
    return *std::move(problem);
  const auto head = http_head(answer);
  if (!head)
    return std::string{"the answer is not HTTP"};
  if (head->status != 200)
    return fmt::format("answers with HTTP status {}", head->status);
  if (head->is_chunked) {
    auto body = joined(std::string_view{answer}.substr(head->bytes));
    return body ? as_metadata(*std::move(body)) : File{std::string{"the answer ends between its chunks"}};
  }
  if (auto problem = problem_of_size(answer.size() - head->bytes, head->content_bytes.value_or(0)))
    return *std::move(problem);
  return as_metadata(answer.substr(head->bytes, head->content_bytes.value_or(kMostBytes)));
}

/// Requests the parts of the metadata one by one (firmware before 2.2). A part that it does not know holds the text of
/// the error, as the maker's client writes it.
File ask_ouster_commands(TcpClient& client) {
  constexpr auto kParts = std::to_array<std::pair<std::string_view, std::string_view>>({
      {"sensor_info", "get_sensor_info\n"},
      {"beam_intrinsics", "get_beam_intrinsics\n"},
      {"imu_intrinsics", "get_imu_intrinsics\n"},
      {"lidar_intrinsics", "get_lidar_intrinsics\n"},
      {"lidar_data_format", "get_lidar_data_format\n"},
      {"calibration_status", "get_calibration_status\n"},
      {"config_params", "get_config_param active\n"},
  });
  const auto is_line = [](std::string_view text) { return text.ends_with('\n'); };
  nlohmann::ordered_json metadata;
  for (const auto& [part, command] : kParts) {
    if (auto problem = client.send(command))
      return *std::move(problem);
    std::string answer;
    if (auto problem = client.receive(answer, kMostBytes, is_line))
      return *std::move(problem);
    if (!is_line(answer))
      return fmt::format("the answer to {} is truncated", command.substr(0, command.size() - 1));
    answer.erase(answer.find_last_not_of(" \r\n") + 1);
    auto parsed = nlohmann::ordered_json::parse(answer, nullptr, false);
    metadata[std::string{part}] = parsed.is_discarded() ? nlohmann::ordered_json(answer) : std::move(parsed);
  }
  constexpr int kIndent = 2;
  return as_metadata(metadata.dump(kIndent, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n");
}

/// Sends command 5 of version 1 of the maker's protocol. Request and response have a header of 8 bytes: 47 74, command,
/// result, length of the content in big-endian order. (The header of version 2, of 12 bytes, begins with 57 75; lidars
/// that support only that one send packets that are not supported.)
File ask_hesai(TcpClient& client) {
  constexpr std::size_t kHeadBytes = 8;
  constexpr std::string_view kQuestion{"\x47\x74\x05\0\0\0\0\0", kHeadBytes};
  if (auto problem = client.send(kQuestion))
    return *std::move(problem);
  const auto end_of = [](std::string_view head) {
    std::size_t bytes = 0;
    for (const char byte : head.substr(4, 4))
      bytes = bytes << 8 | static_cast<unsigned char>(byte);
    return kHeadBytes + bytes;
  };
  const auto is_whole = [&](std::string_view text) {
    return text.size() >= kHeadBytes && (end_of(text) > kMostBytes || text.size() >= end_of(text));
  };
  std::string answer;
  if (auto problem = client.receive(answer, kMostBytes, is_whole))
    return *std::move(problem);
  if (answer.size() < kHeadBytes || !answer.starts_with(kQuestion.substr(0, 3)))
    return std::string{"the answer is not that of a Hesai"};
  if (answer[3] != 0)
    return fmt::format("refuses to send its angles, with code {}", static_cast<unsigned char>(answer[3]));
  if (auto problem = problem_of_size(answer.size(), end_of(answer)))
    return *std::move(problem);
  std::string csv = answer.substr(kHeadBytes, end_of(answer) - kHeadBytes);
  auto angles = hesai::parse_calibration(csv, "its angles");
  return angles ? File{SensorFile{std::move(csv), *std::move(angles)}} : angles.error();
}

/// Removes control characters: the peer is not trusted, and its text must not control the terminal.
std::string printable(std::string_view words) {
  constexpr std::size_t kMost = 300;
  std::string text{words.substr(0, kMost)};
  std::ranges::replace_if(
      text, [](unsigned char c) { return c < ' ' || c >= 0x7F; }, '?');
  return text;
}

} // namespace

Expected<SensorFile, std::string> fetch_sensor_file(const std::string& address, const FetchOptions& options) {
  struct Port {
    std::string_view name;
    std::uint16_t number;
    File (*ask)(TcpClient&);
  };
  const std::array ports{Port{"Ouster (HTTP)", options.ouster_http_port, ask_ouster_http},
                         Port{"Ouster (older firmware)", options.ouster_command_port, ask_ouster_commands},
                         Port{"Hesai", options.hesai_ptc_port, ask_hesai}};
  const bool is_ipv6 = address.find(':') != std::string::npos;
  const std::string host = is_ipv6 ? "[" + address + "]" : address;
  std::string reasons;
  for (const Port& port : ports) {
    const auto to = parse_socket_address(fmt::format("{}:{}", host, port.number));
    if (!to || to->storage.ss_family == AF_UNIX)
      return fmt::format("{}: not an address; name that of the lidar, e.g. 192.168.1.201", address);
    auto client = TcpClient::connect(*to, std::chrono::steady_clock::now() + options.patience);
    File file = client ? port.ask(*client) : client.error();
    if (file)
      return file;
    reasons += fmt::format("  {}, TCP port {}: {}\n", port.name, port.number, printable(file.error()));
  }
  return fmt::format(
      "{}: no lidar answers with its metadata or angles there:\n{}check its power, cable and address, which "
      "locusctl sensors shows; a Velodyne has nothing to fetch",
      address, reasons);
}

} // namespace locus::tools
