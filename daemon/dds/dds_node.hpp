// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include <dds/dds.h>
#include <dds/ddsi/ddsi_serdata.h>

#include "config/config.hpp"
#include "core/base/expected.hpp"
#include "core/base/stamp.hpp"
#include "daemon/dds/ros_types.hpp"

namespace locus::daemon {

/// Owns a DDS entity and deletes it and its children on destruction. One owner.
class DdsEntity {
 public:
  explicit DdsEntity(dds_entity_t handle = 0) : handle_(handle) {}
  ~DdsEntity() {
    if (handle_ > 0)
      dds_delete(handle_);
  }
  DdsEntity(DdsEntity&& other) noexcept : handle_(std::exchange(other.handle_, 0)) {}
  DdsEntity& operator=(DdsEntity&& other) noexcept {
    std::swap(handle_, other.handle_);
    return *this;
  }
  [[nodiscard]] dds_entity_t handle() const { return handle_; }

 private:
  dds_entity_t handle_;
};

/// Returns the IPv4 addresses of a network interface. DDS binds to the first one when it connects.
std::vector<std::string> addresses_of(const std::string& interface);

/// Quality of service of a topic, after ROS 2's own profiles.
struct TopicQos {
  bool reliable = true;
  int depth = 10;
  bool latched = false; ///< late subscribers receive the last message (transient local)

  static constexpr TopicQos standard() { return {true, 10}; }   ///< odometry, diagnostics, commands
  static constexpr TopicQos transform() { return {true, 100}; } ///< tf
  static constexpr TopicQos latch() { return {true, 1, true}; } ///< persistent data
  static constexpr TopicQos cloud() { return {true, 5}; }       ///< as rviz2 requests; matches best-effort readers, too
  static constexpr TopicQos clock() { return {false, 1}; }      ///< only the latest matters
  static constexpr TopicQos sensor_out() { return {false, 5}; } ///< as sensor drivers publish
  static constexpr TopicQos cloud_in() { return {false, 1}; }   ///< matches any writer; only the latest matters
  static constexpr TopicQos cloud_count() { return {false, 20}; } ///< matches any writer; deep enough to count all
  static constexpr TopicQos sensor_in() {
    return {false, 100};
  } ///< best-effort readers match every writer; the depth
    ///< outlasts a stall of this process
};

/// Sets the sink of the DDS library's log, called line by line from any of its threads. One sink per process.
void set_dds_log(std::function<void(bool is_error, std::string_view line)> sink);

/// DDS participant of this process in a ROS 2 network, on the configured domain and interface only. Thread-safe.
class DdsNode {
 public:
  /// Opens the participant. Fails immediately with one line for the user, e.g. if the interface does not exist yet; the
  /// caller may retry.
  static Expected<DdsNode, std::string> open(const DdsOptions& options);

  /// Creates an endpoint on a ROS 2 topic such as "/locus/odometry"; a name without a leading slash is a plain DDS
  /// topic. Negative handles are DDS errors.
  template <class Message> [[nodiscard]] DdsEntity create_writer(const std::string& topic, TopicQos qos) const {
    return create_endpoint(ros::type_of<Message>(), topic, qos, &dds_create_writer);
  }
  template <class Message> [[nodiscard]] DdsEntity create_reader(const std::string& topic, TopicQos qos) const {
    return create_endpoint(ros::type_of<Message>(), topic, qos, &dds_create_reader);
  }

  [[nodiscard]] dds_entity_t participant() const { return participant_.handle(); }

 private:
  using CreateEndpoint = dds_entity_t (*)(dds_entity_t, dds_entity_t, const dds_qos_t*, const dds_listener_t*);

  DdsNode(DdsEntity domain, DdsEntity participant, bool type_hashes)
      : domain_(std::move(domain)), participant_(std::move(participant)), type_hashes_(type_hashes) {}
  [[nodiscard]] DdsEntity create_endpoint(const ros::Type& type, const std::string& topic, TopicQos wanted,
                                          CreateEndpoint create) const;

  DdsEntity domain_; ///< outlives the participant
  DdsEntity participant_;
  bool type_hashes_;
};

/// Publishes messages on one topic. One owner; a default-constructed writer drops its messages.
template <class Message> class DdsWriter {
 public:
  DdsWriter() = default;
  DdsWriter(const DdsNode& node, const std::string& topic, TopicQos qos)
      : writer_(node.create_writer<Message>(topic, qos)) {}

  /// Publishes a message; false if DDS rejects it, e.g. while a reliable reader is far behind.
  [[nodiscard]] bool write(const Message& message) const {
    return dds_write(writer_.handle(), &message) == DDS_RETCODE_OK;
  }
  [[nodiscard]] bool has_readers() const {
    dds_publication_matched_status_t status{};
    return dds_get_publication_matched_status(writer_.handle(), &status) == DDS_RETCODE_OK && status.current_count > 0;
  }

 private:
  DdsEntity writer_;
};

/// Non-owning view of a serialised message, including encapsulation.
class SerialisedSample {
 public:
  explicit SerialisedSample(const ddsi_serdata* sample) : sample_(sample) {}
  [[nodiscard]] std::size_t size() const { return ddsi_serdata_size(sample_); }
  /// Copies the message. Precondition: `bytes` holds at least size() bytes.
  void copy_to(std::span<std::byte> bytes) const { ddsi_serdata_to_ser(sample_, 0, size(), bytes.data()); }

 private:
  const ddsi_serdata* sample_;
};

/// Receives messages of one topic. One owner.
template <class Message> class DdsReader {
 public:
  DdsReader(const DdsNode& node, const std::string& topic, TopicQos qos)
      : reader_(node.create_reader<Message>(topic, qos)) {}

  /// Passes the received messages to `use`, oldest first, with their writer if it accepts one; valid during the call
  /// only. Bounded, however fast messages arrive.
  template <class Use> void take(const Use& use) {
    constexpr std::uint32_t kBatch = 32, kMaxBatches = 4;
    dds_return_t count = kBatch;
    for (std::uint32_t batch = 0; batch < kMaxBatches && count == kBatch; ++batch) {
      std::array<void*, kBatch> samples{};
      std::array<dds_sample_info_t, kBatch> infos{};
      count = dds_take(reader_.handle(), samples.data(), infos.data(), kBatch, kBatch);
      for (std::size_t i = 0; count > 0 && i < static_cast<std::size_t>(count); ++i)
        if (infos[i].valid_data)
          deliver(use, *static_cast<const Message*>(samples[i]), infos[i].publication_handle);
      if (count > 0)
        dds_return_loan(reader_.handle(), samples.data(), count);
    }
  }

  /// Passes the received messages to `use` in serialised form, with their writer; otherwise as take().
  template <class Use> void take_serialised(const Use& use) {
    constexpr std::uint32_t kBatch = 8, kMaxBatches = 4;
    dds_return_t count = kBatch;
    for (std::uint32_t batch = 0; batch < kMaxBatches && count == kBatch; ++batch) {
      std::array<ddsi_serdata*, kBatch> samples{};
      std::array<dds_sample_info_t, kBatch> infos{};
      count = dds_takecdr(reader_.handle(), samples.data(), kBatch, infos.data(), DDS_ANY_STATE);
      for (std::size_t i = 0; count > 0 && i < static_cast<std::size_t>(count); ++i) {
        if (infos[i].valid_data)
          use(SerialisedSample(samples[i]), infos[i].publication_handle);
        ddsi_serdata_unref(samples[i]);
      }
    }
  }

  [[nodiscard]] std::uint32_t writers() const {
    dds_subscription_matched_status_t status{};
    return dds_get_subscription_matched_status(reader_.handle(), &status) == DDS_RETCODE_OK ? status.current_count : 0;
  }
  /// Tells whether a writer is matched; true for any writer beyond 64 matched ones.
  [[nodiscard]] bool is_matched(dds_instance_handle_t writer) const {
    std::array<dds_instance_handle_t, 64> all{};
    const dds_return_t count = dds_get_matched_publications(reader_.handle(), all.data(), all.size());
    const auto end = all.begin() + std::clamp<dds_return_t>(count, 0, all.size());
    return count > static_cast<dds_return_t>(all.size()) || std::find(all.begin(), end, writer) != end;
  }
  [[nodiscard]] dds_entity_t handle() const { return reader_.handle(); }

 private:
  template <class Use> static void deliver(const Use& use, const Message& message, dds_instance_handle_t writer) {
    if constexpr (std::is_invocable_v<Use, const Message&, dds_instance_handle_t>)
      use(message, writer);
    else
      use(message);
  }

  DdsEntity reader_;
};

/// Admits the samples of one writer per topic, the first until it is silent or gone, at a limited rate. Samples of
/// other writers are counted and rejected. One owner.
class Admission {
 public:
  static constexpr std::int64_t kMaxRateKhz = 10; ///< above the rate of any sensor

  /// Tells whether a sample of `writer` at `now` (CLOCK_MONOTONIC) is accepted; otherwise counts it.
  bool admits(dds_instance_handle_t writer, Duration now) {
    if (writer != writer_ && now - last_received_ < kSilence)
      return refuse();
    writer_ = writer;
    last_received_ = now;
    if (now - window_began_ >= kWindow || now < window_began_) {
      window_began_ = now;
      in_window_ = 0;
    }
    return ++in_window_ <= kMaxPerWindow || refuse();
  }
  [[nodiscard]] std::uint64_t refused() const { return refused_; }

  /// Lets another writer take over if `reader` (DdsReader or CloudReader) no longer matches the current one.
  template <class Reader> void update_owner(const Reader& reader) {
    if (!reader.is_matched(writer_))
      last_received_ = {};
  }

 private:
  static constexpr Duration kSilence = std::chrono::seconds{2}; ///< longer than the period of any source
  static constexpr Duration kWindow = std::chrono::milliseconds{100};
  static constexpr std::int64_t kMaxPerWindow = kMaxRateKhz * (kWindow / std::chrono::milliseconds{1});

  bool refuse() {
    ++refused_;
    return false;
  }

  dds_instance_handle_t writer_ = 0;
  Duration last_received_{}, window_began_{};
  std::int64_t in_window_ = 0;
  std::uint64_t refused_ = 0;
};

} // namespace locus::daemon
