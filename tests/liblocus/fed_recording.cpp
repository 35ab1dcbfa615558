// SPDX-License-Identifier: Apache-2.0
#include "fed_recording.hpp"

#include <algorithm>
#include <functional>
#include <iterator>
#include <string>

#include <gtest/gtest.h>

#include "drivers/files/capture.hpp"
#include "drivers/files/capture_folder.hpp"
#include "drivers/files/motion_files.hpp"
#include "drivers/files/pcap_writer.hpp"

namespace locus::test {
namespace {

using liblocus::Estimate;

/// An input and its arrival time, the sort key.
struct Fed {
  Stamp arrival;
  std::function<std::vector<Estimate>(liblocus::Odometry&)> give;
};

std::array<double, 3> array_of(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }
std::array<double, 4> array_of(const Eigen::Quaterniond& q) { return {q.x(), q.y(), q.z(), q.w()}; }

Fed fed(const ImuSample& sample, const std::string& source) {
  liblocus::ImuSample given{.stamp_ns = to_ns(sample.stamp),
                            .arrival_ns = to_ns(sample.arrival),
                            .angular_velocity_radps = array_of(sample.angular_velocity_radps),
                            .specific_force_mps2 = array_of(sample.specific_force_mps2)};
  if (sample.attitude)
    given.orientation_xyzw = array_of(*sample.attitude);
  return {sample.arrival, [=](liblocus::Odometry& odometry) { return odometry.imu(source, given); }};
}

Fed fed(const OdometrySample& sample, const std::string& source) {
  const liblocus::OdometrySample given{.stamp_ns = to_ns(sample.stamp),
                                       .arrival_ns = to_ns(sample.arrival),
                                       .position_m = array_of(sample.T_source_base.translation),
                                       .orientation_xyzw = array_of(sample.T_source_base.rotation),
                                       .covariance_scale = sample.covariance_scale};
  return {sample.arrival, [=](liblocus::Odometry& odometry) { return odometry.odometry(source, given); }};
}

template <class Sample>
void add(std::vector<Fed>& inputs, const std::vector<std::filesystem::path>& files, const std::string& source) {
  auto samples = MotionSamples<Sample>::open(files);
  ASSERT_TRUE(samples) << samples.error();
  for (const Sample& sample : samples->drain())
    inputs.push_back(fed(sample, source));
}

std::vector<Estimate> give_all(liblocus::Odometry& odometry, const std::vector<Fed>& inputs) {
  std::vector<Estimate> estimates;
  const auto keep = [&](std::vector<Estimate> more) { std::ranges::move(more, std::back_inserter(estimates)); };
  for (const Fed& input : inputs)
    keep(input.give(odometry));
  keep(odometry.finish());
  return estimates;
}

std::vector<Fed> fed_all(const std::vector<FedDatagram>& datagrams) {
  std::vector<Fed> inputs;
  for (const FedDatagram& datagram : datagrams)
    inputs.push_back({datagram.arrival, [&datagram](liblocus::Odometry& odometry) {
                        return odometry.packet(datagram.payload, to_ns(datagram.arrival), datagram.port,
                                               datagram.source_ip);
                      }});
  return inputs;
}

} // namespace

std::vector<FedDatagram> datagrams_of(const std::vector<std::filesystem::path>& captures) {
  std::vector<FedDatagram> datagrams;
  for (const std::filesystem::path& file : captures) {
    auto capture = Capture::open(file);
    if (!capture) {
      ADD_FAILURE() << capture.error();
      return {};
    }
    while (const Datagram* datagram = capture->next())
      datagrams.push_back({datagram->receive_stamp,
                           datagram->destination_port,
                           datagram->source_ip,
                           {datagram->payload.begin(), datagram->payload.end()}});
  }
  return datagrams;
}

void write_pcap(const std::vector<FedDatagram>& datagrams, const std::filesystem::path& file) {
  auto writer = PcapWriter::open(file);
  ASSERT_TRUE(writer) << writer.error();
  for (const FedDatagram& datagram : datagrams)
    writer->write(datagram.arrival, {.source_ip = datagram.source_ip, .destination_port = datagram.port},
                  datagram.payload);
  EXPECT_FALSE(writer->flush());
}

std::vector<Estimate> feed(liblocus::Odometry& odometry, const std::vector<FedDatagram>& datagrams) {
  return give_all(odometry, fed_all(datagrams));
}

std::vector<Estimate> feed(liblocus::Odometry& odometry, const std::filesystem::path& folder) {
  const auto files = CaptureFolder::find(folder);
  if (!files) {
    ADD_FAILURE() << files.error();
    return {};
  }
  const std::vector<FedDatagram> datagrams = datagrams_of(files->lidar);
  std::vector<Fed> inputs;
  if (!files->imu.empty())
    add<ImuSample>(inputs, files->imu, "imu");
  for (const CaptureFolder::Source& source : files->odometry)
    add<OdometrySample>(inputs, source.files, source.name);
  std::erase_if(inputs, [&](const Fed& input) {
    return input.arrival < datagrams.front().arrival - std::chrono::seconds{1} ||
           input.arrival > datagrams.back().arrival;
  });
  std::ranges::copy(fed_all(datagrams), std::back_inserter(inputs));
  std::ranges::stable_sort(inputs, {}, &Fed::arrival);
  return give_all(odometry, inputs);
}

} // namespace locus::test
