// SPDX-License-Identifier: Apache-2.0
#include "drivers/net/udp_socket.hpp"

#include <cerrno>
#include <cstring>
#include <ctime>
#include <utility>

#include <arpa/inet.h>
#include <fmt/format.h>
#include <ifaddrs.h>
#include <linux/sock_diag.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

namespace locus {
namespace {

std::string because(const char* what, std::uint16_t port) {
  const int error = errno;
  const char* const advice = error == EADDRINUSE ? "; another program listens there, end it or change the port"
                             : error == EACCES   ? "; ports below 1024 are for root, change the port"
                                                 : "";
  return fmt::format("UDP port {}: {}: {}{}", port, what, std::strerror(error),
                     advice); // NOLINT(concurrency-mt-unsafe)
}

/// Returns the sender's IPv4 address in host byte order; 0 for IPv6. A dual-stack socket, as systemd creates it,
/// reports IPv4 senders as mapped addresses.
std::uint32_t ip_of(const sockaddr_storage& address) {
  std::uint32_t ip = 0;
  if (address.ss_family == AF_INET)
    std::memcpy(&ip, &reinterpret_cast<const sockaddr_in&>(address).sin_addr, sizeof(ip));
  else if (const auto& v6 = reinterpret_cast<const sockaddr_in6&>(address).sin6_addr;
           address.ss_family == AF_INET6 && IN6_IS_ADDR_V4MAPPED(&v6))
    std::memcpy(&ip, &v6.s6_addr[12], sizeof(ip));
  return ntohl(ip);
}

std::uint16_t port_of(const sockaddr_storage& address) {
  if (address.ss_family == AF_INET)
    return ntohs(reinterpret_cast<const sockaddr_in&>(address).sin_port);
  return address.ss_family == AF_INET6 ? ntohs(reinterpret_cast<const sockaddr_in6&>(address).sin6_port)
                                       : std::uint16_t{0};
}

bool set(int descriptor, int level, int option, int value) {
  return setsockopt(descriptor, level, option, &value, sizeof(value)) == 0;
}

/// Returns the buffer size as requested: the kernel doubles it for its book-keeping and reports the double (socket(7)).
int granted_buffer_bytes(int descriptor) {
  int doubled = 0;
  socklen_t size = sizeof(doubled);
  getsockopt(descriptor, SOL_SOCKET, SO_RCVBUF, &doubled, &size);
  return doubled / 2;
}

} // namespace

/// Buffers for recvmmsg(), set up once.
struct UdpSocket::Batch {
  using Control = std::array<std::byte, CMSG_SPACE(sizeof(timespec))>;

  std::array<std::array<std::byte, kLongestPayload>, kBatch> payloads;
  alignas(cmsghdr) std::array<Control, kBatch> controls;
  std::array<sockaddr_storage, kBatch> senders{};
  std::array<iovec, kBatch> vectors{};
  std::array<mmsghdr, kBatch> messages{};
  std::array<Datagram, kBatch> datagrams;

  void prepare() {
    for (std::size_t i = 0; i < kBatch; ++i) {
      vectors[i] = {payloads[i].data(), payloads[i].size()};
      msghdr& header = messages[i].msg_hdr;
      header = {&senders[i], sizeof(sockaddr_storage), &vectors[i], 1, controls[i].data(), controls[i].size(), 0};
    }
  }
};

UdpSocket::UdpSocket(int descriptor) : descriptor_(descriptor), batch_(std::make_unique<Batch>()) {}

UdpSocket::UdpSocket(UdpSocket&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)), port_(other.port_), buffer_bytes_(other.buffer_bytes_),
      kernel_drops_(other.kernel_drops_), filtered_(other.filtered_), has_filter_(other.has_filter_),
      last_drops_(other.last_drops_), batch_(std::move(other.batch_)) {}

UdpSocket::~UdpSocket() {
  if (descriptor_ >= 0)
    close(descriptor_);
}

Expected<UdpSocket, std::string> UdpSocket::open(std::uint16_t port) { return open(port, false); }

Expected<UdpSocket, std::string> UdpSocket::open_shared(std::uint16_t port) { return open(port, true); }

Expected<UdpSocket, std::string> UdpSocket::open(std::uint16_t port, bool shared) {
  UdpSocket opened(::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (opened.descriptor_ < 0)
    return because("no socket", port);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_ANY);
  set(opened.descriptor_, SOL_SOCKET, SO_REUSEPORT, shared ? 1 : 0);
  if (bind(opened.descriptor_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0)
    return because("cannot bind", port);
  if (auto problem = opened.prepare())
    return *problem;
  return opened;
}

Expected<UdpSocket, std::string> UdpSocket::adopt(int descriptor) {
  UdpSocket adopted(descriptor);
  int type = 0;
  socklen_t size = sizeof(type);
  if (getsockopt(descriptor, SOL_SOCKET, SO_TYPE, &type, &size) != 0 || type != SOCK_DGRAM)
    return fmt::format("descriptor {} is no UDP socket; write ListenDatagram= in the socket unit", descriptor);
  set(descriptor, SOL_SOCKET, SO_REUSEADDR, 0); // set by systemd; lets any account bind the port and steal packets
  if (auto problem = adopted.prepare())
    return *problem;
  return adopted;
}

/// Requests the buffer size. SO_RCVBUFFORCE needs a privilege; without it the kernel limits the size to
/// net.core.rmem_max. Keeps a larger buffer that systemd configured (ReceiveBuffer=).
std::optional<std::string> UdpSocket::prepare() {
  sockaddr_storage address{};
  socklen_t size = sizeof(address);
  if (getsockname(descriptor_, reinterpret_cast<sockaddr*>(&address), &size) != 0 || port_of(address) == 0)
    return fmt::format("descriptor {} is bound to no UDP port", descriptor_);
  port_ = port_of(address);
  if (granted_buffer_bytes(descriptor_) < kWantedBufferBytes &&
      !set(descriptor_, SOL_SOCKET, SO_RCVBUFFORCE, kWantedBufferBytes))
    set(descriptor_, SOL_SOCKET, SO_RCVBUF, kWantedBufferBytes);
  buffer_bytes_ = granted_buffer_bytes(descriptor_);
  if (!set(descriptor_, SOL_SOCKET, SO_TIMESTAMPNS, 1))
    return because("no receive timestamps", port_);
  set(descriptor_, SOL_SOCKET, SO_DETACH_FILTER, 0); // left by the previous owner of a socket that systemd holds
  count_drops();                                     // discards the drops counted for the previous owner
  kernel_drops_ = 0;
  return std::nullopt;
}

bool UdpSocket::filter(std::span<sock_filter> program) {
  count_drops();
  const sock_fprog all{static_cast<unsigned short>(program.size()), program.data()};
  const bool done = program.empty() ? set(descriptor_, SOL_SOCKET, SO_DETACH_FILTER, 0)
                                    : setsockopt(descriptor_, SOL_SOCKET, SO_ATTACH_FILTER, &all, sizeof(all)) == 0;
  has_filter_ = done ? !program.empty() : has_filter_;
  return done;
}

/// Adds new drops to the matching counter. The kernel has one 32-bit count for both buffer overflows and filter
/// rejections.
void UdpSocket::count_drops() {
  std::array<std::uint32_t, SK_MEMINFO_VARS> figures{};
  socklen_t size = sizeof(figures);
  if (getsockopt(descriptor_, SOL_SOCKET, SO_MEMINFO, figures.data(), &size) != 0)
    return;
  const std::uint32_t drops = figures[SK_MEMINFO_DROPS];
  (has_filter_ ? filtered_ : kernel_drops_) += drops - last_drops_; // modulo 2^32
  last_drops_ = drops;
}

bool UdpSocket::join(std::uint32_t group_host_order) const {
  ifaddrs* interfaces = nullptr;
  if (getifaddrs(&interfaces) != 0)
    return false;
  bool joined = false;
  for (const ifaddrs* each = interfaces; each != nullptr; each = each->ifa_next) {
    const bool usable = each->ifa_addr != nullptr && each->ifa_addr->sa_family == AF_INET &&
                        (each->ifa_flags & IFF_UP) != 0 && (each->ifa_flags & (IFF_MULTICAST | IFF_LOOPBACK)) != 0;
    if (!usable)
      continue;
    ip_mreqn request{};
    request.imr_multiaddr.s_addr = htonl(group_host_order);
    request.imr_ifindex = static_cast<int>(if_nametoindex(each->ifa_name));
    joined |= setsockopt(descriptor_, IPPROTO_IP, IP_ADD_MEMBERSHIP, &request, sizeof(request)) == 0 ||
              errno == EADDRINUSE; // already joined
  }
  freeifaddrs(interfaces);
  return joined;
}

std::span<const Datagram> UdpSocket::receive() {
  count_drops();
  batch_->prepare();
  const int count = recvmmsg(descriptor_, batch_->messages.data(), kBatch, MSG_DONTWAIT, nullptr);
  if (count <= 0)
    return {};
  timespec clock{};
  clock_gettime(CLOCK_REALTIME, &clock);
  const auto to_stamp = [](const timespec& t) { return Stamp{std::chrono::seconds{t.tv_sec} + Duration{t.tv_nsec}}; };
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
    msghdr& header = batch_->messages[i].msg_hdr;
    const sockaddr_storage& sender = batch_->senders[i];
    Stamp stamp = to_stamp(clock);
    for (cmsghdr* control = CMSG_FIRSTHDR(&header); control != nullptr; control = CMSG_NXTHDR(&header, control)) {
      if (control->cmsg_level != SOL_SOCKET || control->cmsg_type != SO_TIMESTAMPNS)
        continue;
      timespec arrival{};
      std::memcpy(&arrival, CMSG_DATA(control), sizeof(arrival));
      stamp = to_stamp(arrival);
    }
    batch_->datagrams[i] = {{batch_->payloads[i].data(), batch_->messages[i].msg_len},
                            ip_of(sender),
                            port_of(sender),
                            port_,
                            stamp,
                            (header.msg_flags & MSG_TRUNC) != 0};
  }
  return {batch_->datagrams.data(), static_cast<std::size_t>(count)};
}

} // namespace locus
