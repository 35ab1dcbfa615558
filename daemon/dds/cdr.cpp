// SPDX-License-Identifier: Apache-2.0
#include "daemon/dds/cdr.hpp"

#include <array>
#include <cstdint>
#include <memory>
#include <string_view>

#include <dds/ddsi/ddsi_cdrstream.h>

namespace locus::daemon::ros {

void serialise(const void* message, const dds_topic_descriptor_t& type, std::vector<std::byte>& out) {
  constexpr std::array kLittleEndianCdr{std::byte{0}, std::byte{1}, std::byte{0}, std::byte{0}};
  constexpr std::uint32_t kXcdr1 = 1; // used by ROS 2
  dds_ostreamLE_t stream{};
  dds_ostreamLE_init(&stream, 0, kXcdr1);
  const std::unique_ptr<dds_ostreamLE_t, decltype([](dds_ostreamLE_t* s) { dds_ostreamLE_fini(s); })> closer(&stream);
  dds_stream_writeLE(&stream, static_cast<const char*>(message), type.m_ops);
  out.assign(kLittleEndianCdr.begin(), kLittleEndianCdr.end());
  const auto* const begin = reinterpret_cast<const std::byte*>(stream.x.m_buffer);
  out.insert(out.end(), begin, begin + stream.x.m_index);
}

std::string name_in_ros2(const dds_topic_descriptor_t& type) {
  constexpr std::string_view kMiddle = "::msg::dds_::";
  const std::string_view name = type.m_typename;
  const std::size_t middle = name.find(kMiddle);
  std::string ros(name.substr(0, middle));
  ros += "/msg/";
  ros += name.substr(middle + kMiddle.size());
  ros.pop_back(); // trailing underscore
  return ros;
}

} // namespace locus::daemon::ros
