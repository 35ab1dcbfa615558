// SPDX-License-Identifier: Apache-2.0
#include "daemon/dds/ros_graph.hpp"

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <type_traits>
#include <vector>

#include <fmt/format.h>

namespace locus::daemon {
namespace {

bool is_letter_or_digit(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9'); }

/// Escapes characters that are invalid in ROS 2 names. Reversible, so distinct texts stay distinct.
std::string escape(std::string_view text) {
  std::string name;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool is_escape_prefix = text.substr(i, 2) == "_x";
    if (is_letter_or_digit(text[i]) || (text[i] == '_' && !is_escape_prefix))
      name += text[i];
    else
      name += fmt::format("_x{:02x}", static_cast<unsigned char>(text[i]));
  }
  return name;
}

std::vector<dds_entity_t> children_of(dds_entity_t parent) {
  std::vector<dds_entity_t> children(static_cast<std::size_t>(std::max(0, dds_get_children(parent, nullptr, 0))));
  const dds_return_t count = dds_get_children(parent, children.data(), children.size());
  children.resize(std::min(children.size(), static_cast<std::size_t>(std::max(0, count))));
  return children;
}

/// Returns ROS 2's identifier of an entity: its GUID, zero-padded; all zeros without a GUID.
template <class Gid> Gid gid_of(dds_entity_t entity) {
  Gid gid{};
  dds_guid_t guid{};
  if (dds_get_guid(entity, &guid) == DDS_RETCODE_OK)
    std::copy(std::begin(guid.v), std::end(guid.v), std::begin(gid.data_));
  return gid;
}

template <class Gid> struct Endpoints { std::vector<Gid> readers, writers; };

/// Lists the readers and writers, which are children of the participant's subscribers and publishers.
template <class Gid> Endpoints<Gid> endpoints_of(dds_entity_t participant) {
  Endpoints<Gid> all;
  for (const dds_entity_t group : children_of(participant))
    for (const dds_entity_t endpoint : children_of(group)) {
      if (dds_get_subscriber(endpoint) > 0)
        all.readers.push_back(gid_of<Gid>(endpoint));
      else if (dds_get_publisher(endpoint) > 0)
        all.writers.push_back(gid_of<Gid>(endpoint));
    }
  return all;
}

template <class Sequence, class Item> void set_sequence(Sequence& sequence, std::vector<Item>& items) {
  const auto count = static_cast<std::uint32_t>(items.size());
  sequence = {count, count, items.data(), false};
}

/// Publishes the announcement. Its own writer is not listed as an endpoint of the node, as in ROS 2.
template <class Info> DdsEntity write_announcement(RosNode node, const DdsNode& from) {
  using Gid = decltype(Info::gid_);
  using Node = std::remove_pointer_t<decltype(Info{}.node_entities_info_seq_._buffer)>;
  Endpoints<Gid> endpoints = endpoints_of<Gid>(from.participant());
  std::vector<Node> nodes(1);
  nodes.front().node_namespace_ = node.name_space.data();
  nodes.front().node_name_ = node.name.data();
  set_sequence(nodes.front().reader_gid_seq_, endpoints.readers);
  set_sequence(nodes.front().writer_gid_seq_, endpoints.writers);
  Info info{};
  info.gid_ = gid_of<Gid>(from.participant());
  set_sequence(info.node_entities_info_seq_, nodes);
  DdsEntity writer = from.create_writer<Info>("ros_discovery_info", TopicQos::latch());
  dds_write(writer.handle(), &info);
  return writer;
}

} // namespace

RosNode ros_node(std::string_view prefix, std::string_view instance) {
  const std::string_view parent = prefix.substr(0, prefix.rfind('/'));
  return {parent.empty() ? "/" : std::string(parent), instance.empty() ? "locusd" : "locusd_" + escape(instance)};
}

DdsEntity announce(const RosNode& node, const DdsNode& from, RosGraph graph) {
  switch (graph) {
  case RosGraph::iron:
    return write_announcement<ros::ParticipantEntitiesInfo>(node, from);
  case RosGraph::humble:
    return write_announcement<ros::HumbleParticipantEntitiesInfo>(node, from);
  case RosGraph::off:
    break;
  }
  return DdsEntity{};
}

} // namespace locus::daemon
