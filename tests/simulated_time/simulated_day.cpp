// SPDX-License-Identifier: Apache-2.0
#include "simulated_time/simulated_day.hpp"

#include <algorithm>
#include <csignal>
#include <ctime>
#include <fstream>
#include <thread>
#include <utility>

#include <fmt/format.h>

#include "config/config_yaml.hpp"
#include "daemon/dds/ros_messages.hpp"
#include "daemon/machine_time.hpp"
#include "locus_replay/failure.hpp"
#include "locusctl/service_client.hpp"

namespace locus::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using enum DayFault;

constexpr Duration kLap = seconds{120};
constexpr Duration kTick = milliseconds{50};
constexpr Duration kTooLate =
    milliseconds{25}; ///< lag of this machine: together with the period of a source, half of its timeout

Config config_of(const soak::ClosedCourse& course) {
  auto config = load_config(course.folder / "config.yaml");
  if (!config)
    throw tools::Failure(tools::ExitStatus::failed, fmt::format("{}", fmt::join(config.error(), "\n")));
  config->odometry.threads = 1;
  config->dds.interface = "dds0";
  config->record = {"recordings", 10'000'000};
  return *std::move(config);
}

} // namespace

SimulatedDay::SimulatedDay(const DayOptions& options, RobotComputer& computer)
    : options_(options), computer_(computer), system_began_(system_time()) {
  const soak::ClosedCourse course = soak::closed_course(options.course_folder, kLap);
  config_ = config_of(course);
  std::ofstream{computer_.file("locusd.yaml")} << print_config(config_);
  computer_.over_there([&] { motion_ = std::make_unique<tools::MotionPublisher>(config_, false); });
  listener_ = std::make_unique<Listener>(motion_->node());
  setenv("STATE_DIRECTORY", computer_.state().c_str(), 1);                         // NOLINT(concurrency-mt-unsafe)
  setenv("RUNTIME_DIRECTORY", computer_.file("control").parent_path().c_str(), 1); // NOLINT(concurrency-mt-unsafe)
  systemd_ = std::make_unique<SystemdStandIn>(
      std::vector<std::string>{LOCUSD, "--config", computer_.file("locusd.yaml").string()}, computer_.file("notify"));
  robot_ = std::make_unique<RobotSender>(course, config_, *motion_, clock_);
  frames_ = std::make_unique<FrameJudge>(*robot_, events_);
  service_ = std::make_unique<ServiceJudge>(events_);
  began_ = daemon::read_clock(CLOCK_MONOTONIC);
}

SimulatedDay::~SimulatedDay() = default;

Duration SimulatedDay::now() const { return daemon::read_clock(CLOCK_MONOTONIC) - began_; }

void SimulatedDay::run() {
  struct Change {
    Duration at;
    const ScheduledFault* fault;
    bool begins;
  };
  const std::vector<ScheduledFault> faults = schedule_faults(options_.seed, options_.lasts, options_.mean_pause);
  std::vector<Change> changes;
  for (const ScheduledFault& fault : faults) {
    changes.push_back({fault.begin, &fault, true});
    changes.push_back({fault.end(), &fault, false});
  }
  std::ranges::stable_sort(changes, {}, &Change::at);
  faults_ = faults.size();
  auto change = changes.begin();
  for (Duration tick = kTick; tick < options_.lasts; tick += kTick) {
    if (const Duration early = tick - now(); early > Duration::zero())
      std::this_thread::sleep_for(early);
    measure_lag();
    tick = std::max(tick, now() - kTick); // missed checks are skipped
    events_.set_now(now());
    for (; change != changes.end() && change->at <= now(); ++change)
      change->begins ? begin(*change->fault) : end(*change->fault);
    look();
  }
  service_->conclude(faults_);
}

void SimulatedDay::measure_lag() {
  if (const Duration late = robot_->worst_lag(); late > kTooLate)
    events_.disturb(fmt::format("the sender was {:.0f} ms late", 1e3 * to_seconds(late)));
}

void SimulatedDay::look() {
  constexpr Duration kEvery = seconds{1}, kWeighEvery = seconds{30}, kYoung = seconds{20};
  if (deaf_ && !deaf_->lines().empty())
    deaf_->signal(SIGSTOP);
  const auto life = systemd_->life();
  if (life && life->number != std::exchange(life_, life->number)) {
    service_->begin_life();
    frames_->begin_life();
  }
  frames_->look(*listener_, clock_);
  if (life)
    service_->look_at_delays(*life, clock_.rate());
  if (now() - looked_ < kEvery)
    return;
  looked_ = now();
  service_->read(systemd_->new_lines());
  if (!life || now() + began_ - life->since < kYoung || events_.any({process_stop, thread_hang, crash}, seconds{12}))
    return;
  try {
    const std::uint64_t sent = robot_->sent();
    service_->look(tools::send_request(computer_.file("control"), {{"command", "status"}}).json, sent);
  } catch (const tools::Failure& failure) {
    events_.find(fmt::format("the status cannot be read: {}", failure.what()));
  }
  if (now() - weighed_ < kWeighEvery)
    return;
  weighed_ = now();
  service_->weigh(*life);
}

void SimulatedDay::begin(const ScheduledFault& fault) {
  fmt::print("{}\n", to_text(fault));
  events_.begin(fault.kind);
  robot_->set(fault.kind, true);
  act_on_process(fault, true);
  if (fault.kind == clock_step)
    clock_.step(fault.step);
  else if (fault.kind == link_down)
    computer_.set_link(false);
  else if (fault.kind == disk_full)
    computer_.set_disk_full(true);
  else if (fault.kind == reload || fault.kind == broken_config)
    reload_configuration(fault.kind == broken_config);
  else if (fault.kind == second_odometry)
    second_ = std::make_unique<daemon::DdsWriter<daemon::ros::Odometry>>(motion_->node(), "/wheel_odometry",
                                                                         daemon::TopicQos::standard());
  else if (fault.kind == deaf_reader)
    deaf_ = std::make_unique<Child>(computer_.there({CYCLONE_PEER, "0", "listen", "/locus", "dds0"}));
}

void SimulatedDay::end(const ScheduledFault& fault) {
  events_.end(fault.kind);
  robot_->set(fault.kind, false);
  act_on_process(fault, false);
  if (fault.kind == link_down)
    computer_.set_link(true);
  else if (fault.kind == disk_full)
    computer_.set_disk_full(false);
  else if (fault.kind == second_odometry)
    second_.reset();
  else if (fault.kind == deaf_reader)
    deaf_.reset();
}

void SimulatedDay::act_on_process(const ScheduledFault& fault, bool begins) {
  if (fault.kind == process_stop)
    systemd_->signal(begins ? SIGSTOP : SIGCONT);
  else if (fault.kind == crash && begins)
    systemd_->signal(SIGKILL);
  else if (fault.kind == thread_hang && !begins)
    hanging_.reset();
  else if (const auto life = systemd_->life(); fault.kind == thread_hang && life)
    hanging_ = std::make_unique<Child>(std::vector<std::string>{HANG_THREAD, std::to_string(life->pid), fault.thread});
}

/// A truncated file is reported as an error and changes nothing.
void SimulatedDay::reload_configuration(bool broken) {
  const std::filesystem::path file = computer_.file("locusd.yaml");
  const std::string text = print_config(config_);
  if (broken)
    std::ofstream{file} << text.substr(0, text.find("T_base_lidar") + 20);
  std::string refused;
  try {
    tools::send_request(computer_.file("control"), {{"command", "reload"}});
    service_->begin_life();
    frames_->begin_life();
  } catch (const tools::Failure& failure) {
    refused = failure.what();
  }
  std::ofstream{file} << text;
  if (refused.empty() == broken && !events_.any({process_stop, thread_hang, crash}, seconds{15}))
    events_.find(broken ? "a truncated configuration was accepted" : "a reload was rejected: " + refused);
}

std::string SimulatedDay::summary() const {
  return fmt::format(
      "seed {}: {:.2f} simulated hours in {:.1f} min; {} faults, {} lives of the service, {} ended by the "
      "watchdog; {} estimates received, {} frames started, {} restarted; at worst {:.3f} m off in 10 s while all "
      "sensors send; {} lines of log, {:.0f} MB at most; packets balanced {} times; this machine "
      "was too slow for {:.1f} % of it",
      options_.seed, to_seconds(events_.now()) / 3600, to_seconds(system_time() - system_began_) / 60, faults_, life_,
      systemd_->watchdog_kills(), frames_->heard(), frames_->beginnings(), frames_->anew(), frames_->worst_healthy_m(),
      service_->lines(), service_->peak_rss_mb(), service_->balances(), 100 * disturbed_share());
}

} // namespace locus::test
