// SPDX-License-Identifier: Apache-2.0
#include "daemon/dds/dds_node.hpp"

#include <array>
#include <cerrno>
#include <cstring>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "drivers/net/datagram.hpp"

namespace locus::daemon {
namespace {

struct QosDeleter {
  void operator()(dds_qos_t* qos) const { dds_delete_qos(qos); }
};
using Qos = std::unique_ptr<dds_qos_t, QosDeleter>;

/// Returns the Cyclone DDS configuration. Loopback is local to the host; its multicast, needed for discovery of later
/// participants, must be enabled here since lo does not advertise it. The linger time bounds the wait of a closing
/// writer for slow readers, as the service stops within a second. The receive buffer holds a cloud of a few megabytes,
/// which arrives in a burst and whose best-effort fragments are not resent. Shared memory stays off: without its broker
/// a participant waits forever.
std::string cyclone_configuration(const std::string& interface) {
  const bool loopback = interface == "lo";
  return fmt::format("<CycloneDDS><Domain><General><Interfaces><NetworkInterface name=\"{}\"{}/></Interfaces>{}"
                     "</General><Internal><WriterLingerDuration>50 ms</WriterLingerDuration>"
                     "<SocketReceiveBufferSize max=\"8 MB\"/></Internal></Domain>"
                     "</CycloneDDS>",
                     interface, loopback ? " multicast=\"true\"" : "",
                     loopback ? "<AllowMulticast>spdp</AllowMulticast>" : "");
}

Qos make_qos(TopicQos wanted) {
  constexpr dds_data_representation_id_t kXcdr1 = DDS_DATA_REPRESENTATION_XCDR1;
  Qos qos{dds_create_qos()};
  dds_qset_reliability(qos.get(), wanted.reliable ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT,
                       DDS_MSECS(100));
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, wanted.depth);
  dds_qset_durability(qos.get(), wanted.latched ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
  dds_qset_data_representation(qos.get(), 1, &kXcdr1);
  dds_qset_writer_data_lifecycle(qos.get(), false);
  return qos;
}

void set_user_data(dds_qos_t* qos, std::string_view text) { dds_qset_userdata(qos, text.data(), text.size()); }

struct SecurityFile {
  const char* property;
  const char* name;
};
constexpr std::array kEnclave{SecurityFile{"dds.sec.auth.identity_ca", "identity_ca.cert.pem"},
                              SecurityFile{"dds.sec.auth.identity_certificate", "cert.pem"},
                              SecurityFile{"dds.sec.auth.private_key", "key.pem"},
                              SecurityFile{"dds.sec.access.permissions_ca", "permissions_ca.cert.pem"},
                              SecurityFile{"dds.sec.access.governance", "governance.p7s"},
                              SecurityFile{"dds.sec.access.permissions", "permissions.p7s"}};

/// Sets the security plugins of Cyclone DDS and their files for a participant. Returns the problem, if any.
std::optional<std::string> set_security(dds_qos_t* qos, const std::string& folder) {
  for (const auto& [kind, library, suffix] : {std::array{"auth", "dds_security_auth", "authentication"},
                                              std::array{"access", "dds_security_ac", "access_control"},
                                              std::array{"crypto", "dds_security_crypto", "crypto"}}) {
    const std::string prefix = fmt::format("dds.sec.{}.", kind);
    dds_qset_prop(qos, (prefix + "library.path").c_str(), library);
    dds_qset_prop(qos, (prefix + "library.init").c_str(), fmt::format("init_{}", suffix).c_str());
    dds_qset_prop(qos, (prefix + "library.finalize").c_str(), fmt::format("finalize_{}", suffix).c_str());
  }
  for (const auto& [property, name] : kEnclave) {
    const std::string file = folder + "/" + name;
    if (access(file.c_str(), R_OK) != 0)
      return fmt::format("{}: {}; dds.security names a folder with the files of an enclave, readable for this user",
                         file,
                         std::strerror(errno)); // NOLINT(concurrency-mt-unsafe)
    dds_qset_prop(qos, property, ("file:" + file).c_str());
  }
  return std::nullopt;
}

std::vector<std::string> interfaces() {
  std::vector<std::string> names;
  const std::unique_ptr<struct if_nameindex, decltype(&if_freenameindex)> all{if_nameindex(), &if_freenameindex};
  for (const struct if_nameindex* one = all.get(); one != nullptr && one->if_index != 0; ++one)
    names.emplace_back(one->if_name);
  return names;
}

std::function<void(bool, std::string_view)>& log_sink() {
  static std::function<void(bool, std::string_view)> sink;
  return sink;
}

/// Assembles log lines, which the library delivers in pieces that end with a line feed.
void collect_log_line(void*, const dds_log_data_t* data) {
  static std::mutex mutex;
  static std::string line;
  const std::scoped_lock lock(mutex);
  line.append(data->message, data->size);
  if (line.empty() || line.back() != '\n')
    return;
  line.pop_back();
  if (log_sink())
    log_sink()((data->priority & (DDS_LC_FATAL | DDS_LC_ERROR)) != 0, line);
  line.clear();
}

} // namespace

std::vector<std::string> addresses_of(const std::string& interface) {
  std::vector<std::string> addresses;
  ifaddrs* all = nullptr;
  if (getifaddrs(&all) != 0)
    return addresses;
  for (const ifaddrs* one = all; one != nullptr; one = one->ifa_next) {
    if (one->ifa_addr == nullptr || one->ifa_addr->sa_family != AF_INET || interface != one->ifa_name)
      continue;
    sockaddr_in address{};
    std::memcpy(&address, one->ifa_addr, sizeof(address));
    addresses.push_back(dotted(ntohl(address.sin_addr.s_addr)));
  }
  freeifaddrs(all);
  return addresses;
}

void set_dds_log(std::function<void(bool, std::string_view)> sink) {
  log_sink() = std::move(sink);
  dds_set_log_sink(&collect_log_line, nullptr);
}

Expected<DdsNode, std::string> DdsNode::open(const DdsOptions& options) {
  if (if_nametoindex(options.interface.c_str()) == 0)
    return fmt::format("dds.interface: no network interface {}; there are {}", options.interface,
                       fmt::join(interfaces(), ", "));
  const auto failed = [&](const char* what, dds_entity_t code) {
    return fmt::format("DDS could not create a {} in domain {} on interface {} ({}); bring the interface up, or set "
                       "dds.interface to one that is",
                       what, options.domain, options.interface, dds_strretcode(code));
  };
  const auto id = static_cast<dds_domainid_t>(options.domain);
  DdsEntity domain{dds_create_domain(id, cyclone_configuration(options.interface).c_str())};
  if (domain.handle() < 0)
    return failed("domain", domain.handle());
  const Qos qos{dds_create_qos()};
  set_user_data(qos.get(), "enclave=/;"); // as in every ROS 2 node
  if (const auto problem = options.security.empty() ? std::nullopt : set_security(qos.get(), options.security))
    return *problem;
  DdsEntity participant{dds_create_participant(id, qos.get(), nullptr)};
  if (participant.handle() < 0 && !options.security.empty())
    return fmt::format("DDS did not accept the enclave {} for domain {}; check that its certificates are valid today, "
                       "their permissions name this domain, and all are signed by its authorities (security.md)",
                       options.security, options.domain);
  if (participant.handle() < 0)
    return failed("participant", participant.handle());
  return DdsNode{std::move(domain), std::move(participant), options.type_hashes};
}

DdsEntity DdsNode::create_endpoint(const ros::Type& type, const std::string& topic, TopicQos wanted,
                                   CreateEndpoint create) const {
  const Qos qos = make_qos(wanted);
  const std::string dds_topic = topic.starts_with('/') ? "rt" + topic : topic;
  const dds_entity_t handle = dds_create_topic(participant(), type.descriptor, dds_topic.c_str(), qos.get(), nullptr);
  if (type_hashes_ && !type.hash.empty())
    set_user_data(qos.get(), fmt::format("typehash=RIHS01_{};", type.hash));
  DdsEntity endpoint{create(participant(), handle, qos.get(), nullptr)};
  if (handle > 0)
    dds_delete(handle); // stays alive with the endpoint
  return endpoint;
}

} // namespace locus::daemon
