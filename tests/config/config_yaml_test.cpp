// SPDX-License-Identifier: Apache-2.0
#include "config/config_yaml.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <random>

#include <fmt/format.h>

#include "drivers/hesai/model.hpp"
#include "drivers/velodyne/model.hpp"
#include "support/temporary_file.hpp"
#include "yaml_tree.hpp"

namespace locus {
namespace {

/// All keys with values different from kBase, except the version, which has only one value.
const std::string kAllChanged = R"(
version: 1
defaults: true
lidars:
  - {name: top, model: Ouster, port: 2400, source_ip: 192.168.1.201, multicast_ip: 239.1.2.3, time: sensor, calibration: "a, b}: #\n", topic: "", point_times: auto, metadata: top.json, T_base_lidar: {xyz_m: [0.1, -2e-07, 3], rpy_deg: [1, 30, -179.5]}}
  - {name: roof, model: auto, port: 2368, source_ip: any, multicast_ip: none, time: auto, calibration: "", topic: /points, point_times: none, metadata: "", T_base_lidar: {xyz_m: [3, 2, 1], rpy_deg: [3, 2, 1]}}
motion_sources:
  - {name: vio, kind: odometry, topic: /vio, health_topic: /vio/health, use_acceleration: auto, T_base_source: {xyz_m: [0, 0, 0], rpy_deg: [0, 0, 0]}, late_ms: 12.5, scale: 1.05, yaw_scale: 0.9, calibration: report, calibration_sigma: {late_ms: auto, mounting_deg: auto, scale: 0.05, yaw_scale: 0}}
  - {name: gyro, kind: imu, topic: /gyro, health_topic: /gyro_2, use_acceleration: off, T_base_source: {xyz_m: [0.3333333333333333, 1, 2], rpy_deg: [90, 0, 45]}, late_ms: -40, scale: 1, yaw_scale: 1, calibration: off, calibration_sigma: {late_ms: 0, mounting_deg: 2, scale: auto, yaw_scale: auto}}
sweep_period_ms: 66.666667
motion_correction: false
range_m: [0.1, 77.7]
body_box: {enabled: true, min_m: [-2, -2, -2], max_m: [2, 2, 2]}
segment_filter: {enabled: false, points: 1234}
voxel_filter: {enabled: true, leaf_m: 0.3}
random_filter: {enabled: true, keep: 0.7}
seed: 18446744073709551615
fusion: queue
no_source_prior: identity
motion: {max_speed_mps: 40, max_acceleration_mps2: 12.5}
scan_to_scan: {mode: off, max_iterations: 7, max_correspondence_m: 1.5}
scan_to_submap: {max_iterations: 8, max_correspondence_m: 0.6}
map: {keyframe_m: 2, keyframe_deg: 31, max_bytes: 123456789}
flat_ground: on
threads: 3
realtime: {priority: 50, cpus: [2, 3], lock_memory: true}
dds: {domain: 7, interface: eth1, prefix: /robot/locus, frame_odom: odom_2, frame_base: base, publish_tf: true, publish_cloud: true, publish_map: true, flat_ground_topic: /flat, security: /etc/enclave, type_hashes: false, ros_graph: humble}
record: {folder: /data/drives, max_bytes: 98765432, keep_s: 30.5, keep_bytes: 87654321, incidents_bytes: 876543210}
metrics: {listen: "[::1]:9465"}
)";

/// The defaults, modified so that each value of kAllChanged alone is valid among them.
const std::string kBase = R"(
lidars:
  - {name: front}
  - {name: rear, topic: /rear/points}
motion_sources:
  - {name: a, kind: imu}
  - {name: b, kind: odometry}
body_box: {min_m: [-1, -1, -1], max_m: [1, 1, 1]}
)";

Config valid(const Expected<Config, ConfigErrors>& config) {
  if (config)
    return *config;
  for (const std::string& error : config.error())
    ADD_FAILURE() << error;
  return {};
}

ConfigErrors errors_of(const Expected<Config, ConfigErrors>& config) {
  return config ? ConfigErrors{} : config.error();
}

ConfigErrors errors_in(const std::string& yaml) { return errors_of(parse_config(yaml, "robot.yaml")); }

Config with(const Config& config, const std::vector<std::string>& assignments) {
  return valid(override_config(config, assignments));
}

ConfigErrors errors_with(const std::vector<std::string>& assignments) {
  return errors_of(override_config(Config{}, assignments));
}

TEST(Config, DefaultsHaveNoProblem) { EXPECT_EQ(Config{}.problem(), std::nullopt); }

TEST(ConfigYaml, EmptyTextAndEmptySectionsAreTheDefaults) {
  for (const char* text : {"", "# nothing\n", "---\n", "{}", "dds:\nvoxel_filter:\n"})
    EXPECT_EQ(valid(parse_config(text, "robot.yaml")), Config{}) << text;
}

TEST(ConfigYaml, PrintedDefaultsReadBackEqual) {
  EXPECT_EQ(valid(parse_config(print_config(Config{}), "printed")), Config{});
}

TEST(ConfigYaml, EveryKeyChangedReadsBackEqual) {
  const Config changed = valid(parse_config(kAllChanged, "changed"));
  const std::string printed = print_config(changed);
  EXPECT_EQ(test::leaves_of(printed), test::leaves_of(kAllChanged));
  EXPECT_EQ(valid(parse_config(printed, "printed")), changed);
}

TEST(ConfigYaml, EveryKeyAloneChangesItselfAndNothingElse) {
  const Config base = valid(parse_config(kBase, "base"));
  const auto base_leaves = test::leaves_of(print_config(base));
  const auto changed_leaves = test::leaves_of(kAllChanged);
  const auto is_of_an_imu = [](const std::string& path) {
    return path.ends_with("use_acceleration") || path.ends_with("sigma.late_ms") || path.ends_with("mounting_deg") ||
           path.find("T_base_source") != std::string::npos;
  };
  const auto is_of_an_odometry = [](const std::string& path) { return path.ends_with("scale"); };
  const auto is_of_clouds = [](const std::string& path) {
    return path.ends_with(".topic") || path.ends_with(".point_times");
  };
  const auto is_of_packets = [](const std::string& path) {
    return std::ranges::any_of(
        std::array{".model", ".port", ".source_ip", ".multicast_ip", ".time", ".calibration", ".metadata"},
        [&](const char* key) { return path.ends_with(key); });
  };
  for (const auto& [path, value] : base_leaves) {
    if ((path.starts_with("lidars.0.") && is_of_clouds(path)) || (path.starts_with("lidars.1.") && is_of_packets(path)))
      continue; // the first sends packets, the second publishes clouds
    if (path == "version" || (path.starts_with("motion_sources.0.") && is_of_an_imu(path)))
      continue; // kAllChanged has an odometry there
    if (path.starts_with("motion_sources.1.") && is_of_an_odometry(path))
      continue; // and an imu there
    const bool needs_an_imu = path.starts_with("motion_sources.1.") && is_of_an_imu(path);
    const bool needs_an_odometry = path.starts_with("motion_sources.0.") && is_of_an_odometry(path);
    const Config start = needs_an_imu        ? with(base, {"motion_sources.1.kind=imu"})
                         : needs_an_odometry ? with(base, {"motion_sources.0.kind=odometry"})
                                             : base;
    const Config one_changed = with(start, {path + '=' + changed_leaves.at(path)});
    auto expected = test::leaves_of(print_config(start));
    EXPECT_NE(expected.at(path), changed_leaves.at(path)) << path;
    expected[path] = changed_leaves.at(path);
    EXPECT_EQ(test::leaves_of(print_config(one_changed)), expected) << path;
    EXPECT_NE(one_changed, start) << path;
    EXPECT_NE(config_sha256(one_changed), config_sha256(start)) << path;
  }
}

TEST(ConfigYaml, LidarHasPacketsOrClouds) {
  EXPECT_TRUE(errors_in("lidars: [{name: a, topic: /points, point_times: azimuth}, {name: b}, {name: c, topic: /c}]\n")
                  .empty());
  const std::array<std::pair<const char*, const char*>, 6> packet_keys{{{"model", "VLP-16"},
                                                                        {"port", "2400"},
                                                                        {"source_ip", "10.0.0.1"},
                                                                        {"multicast_ip", "239.1.2.3"},
                                                                        {"time", "sensor"},
                                                                        {"calibration", "a.yaml"}}};
  for (const auto& [key, value] : packet_keys)
    EXPECT_EQ(
        errors_in(fmt::format("lidars: [{{name: a, topic: /points, {}: {}}}]\n", key, value)),
        ConfigErrors{fmt::format("robot.yaml:1: lidars.0.{}: belongs to packets, and topic /points to clouds; leave "
                                 "out one of the two",
                                 key)});
  EXPECT_NE(errors_in("lidars: [{point_times: none}]\n").at(0).find("name their topic"), std::string::npos);
  EXPECT_NE(errors_in("lidars: [{topic: points}]\n").at(0).find("is not a topic"), std::string::npos);
  EXPECT_NE(errors_in("lidars: [{name: a, topic: /p}, {name: b, topic: /p}]\n").at(0).find("that of another lidar"),
            std::string::npos);
  EXPECT_NE(errors_in("lidars: [{topic: /imu/data}]\n").at(0).find("cannot have PointCloud2"), std::string::npos);
}

TEST(ConfigYaml, AnglesRoundTripToANanodegreeEvenInGimbalLock) {
  std::mt19937 random{1};
  std::uniform_real_distribution<double> angle_rad{-3.1, 3.1};
  for (int i = 0; i < 200; ++i) {
    Config config;
    const double pitch_rad = i % 4 == 0 ? std::copysign(std::acos(0.0), angle_rad(random)) : angle_rad(random);
    config.lidars[0].T_base_lidar.rotation = from_rpy_rad({angle_rad(random), pitch_rad, angle_rad(random)});
    const Config again = valid(parse_config(print_config(config), "printed"));
    EXPECT_LT(again.lidars[0].T_base_lidar.rotation.angularDistance(config.lidars[0].T_base_lidar.rotation), 1e-9);
    EXPECT_EQ(print_config(again), print_config(config));
  }
}

TEST(ConfigYaml, UnknownKeyNamesFileLineAndNearestKey) {
  EXPECT_EQ(errors_in("threads: 2\nvoxel_filter: {enabeld: true}\n"),
            ConfigErrors{"robot.yaml:2: voxel_filter.enabeld: unknown key; the nearest known one is 'enabled'"});
  EXPECT_EQ(errors_in("\n\nfussion: queue\n"),
            ConfigErrors{"robot.yaml:3: fussion: unknown key; the nearest known one is 'fusion'"});
}

TEST(ConfigYaml, AllMistakesAreReportedInTheOrderOfTheirLines) {
  EXPECT_EQ(errors_in("threads: 0\n"
                      "lidars:\n"
                      "  - {name: a, port: abc}\n"
                      "  - name: b\n"
                      "    T_base_lidar: {xyz_m: [1, 2]}\n"
                      "    port: 2369\n"
                      "fusion: best\n"
                      "map:\n"
                      "  keyframe_m: 1\n"
                      "  keyframe_m: 2\n"
                      "  keyframe: 3\n"
                      "  keyframe_deg: 0\n"
                      "range_m: [5, 1]\n"),
            (ConfigErrors{
                "robot.yaml:1: threads: 0 is outside 1 .. 256",
                "robot.yaml:3: lidars.0.port: must be a whole number, 0 or more",
                "robot.yaml:5: lidars.1.T_base_lidar.xyz_m: must be a list of 3 finite numbers",
                "robot.yaml:7: fusion: must be combined | queue",
                "robot.yaml:10: map.keyframe_m: is repeated, first in line 9",
                "robot.yaml:11: map.keyframe: unknown key; the nearest known one is 'keyframe_m'",
                "robot.yaml:12: map.keyframe_deg: 0 is outside 1 .. 180",
                "robot.yaml:13: range_m: must be [nearest, farthest] with 0 <= nearest < farthest <= 1000",
            }));
}

TEST(ConfigYaml, ModelNameSelectsTheMaker) {
  for (std::size_t i = 0; i < hesai::kModels; ++i) {
    const auto model = static_cast<hesai::Model>(i);
    const std::string word = "model: " + std::string{to_string(model)};
    const Config config = valid(parse_config("lidars: [{name: front, " + word + "}]", "robot.yaml"));
    EXPECT_EQ(config.lidars[0].hesai, model);
    EXPECT_EQ(config.lidars[0].model, std::nullopt);
    EXPECT_TRUE(config.lidars[0].is_hesai());
    EXPECT_NE(print_config(config).find(word), std::string::npos) << word;
    EXPECT_EQ(valid(parse_config(print_config(config), "robot.yaml")), config);
  }
  const Config velodyne = valid(parse_config("lidars: [{name: front, model: VLS-128}]", "robot.yaml"));
  EXPECT_EQ(velodyne.lidars[0].model, velodyne::Model::vls128);
  EXPECT_FALSE(velodyne.lidars[0].is_hesai());
  const Config any = valid(parse_config("lidars: [{name: front, calibration: a.csv}]", "robot.yaml"));
  EXPECT_TRUE(any.lidars[0].is_hesai()) << "such files are Hesai's";
  EXPECT_FALSE(any.lidars[0].is_of_any_maker());
}

struct BadValue {
  std::string assignment;
  std::string reason;
};

TEST(ConfigYaml, EveryKindOfBadValueIsRejectedWithItsKeyAndReason) {
  const std::vector<BadValue> bad_values{
      {"threads=2.5", "must be a whole number"},
      {"threads=many", "must be a whole number"},
      {"threads=99999999999", "is outside"},
      {"threads=[1]", "must be a whole number"},
      {"threads=", "must be a whole number"},
      {"lidars.front.port=-1", "0 or more"},
      {"lidars.front.port=0", "is outside 1 .. 65535"},
      {"lidars.front.port=65536", "is outside 0 .. 65535"},
      {"lidars.front.name=2nd", "is not a name"},
      {"lidars.front.name=total", "is taken"},
      {"lidars.front.model=VLP-17", "must be VLP-16 | Puck-Hi-Res | VLP-32C | HDL-32E | VLS-128 | Pandar40P | Pandar64 "
                                    "| QT64 | XT16 | XT32 | XT32M | QT128 | OT128 | Ouster, or auto"},
      {"lidars.front.source_ip=192.168.1.256", "must be an address"},
      {"lidars.front.multicast_ip=192.168.1.201", "must be within 224.0.0.0"},
      {"lidars.front.time=gps", "must be auto | sensor | receive"},
      {"lidars.front.calibration=[a]", "must be text"},
      {"lidars.front.T_base_lidar.rpy_deg=[0, .inf, 0]", "must be a list of 3 finite numbers"},
      {"lidars=[]", "1 to 16"},
      {"lidars={name: a}", "must be a list"},
      {"motion_sources=[5]", "must be a section of keys"},
      {"motion_sources=[{kind: imu}]", "is not a name"},
      {"motion_sources.wio.topic=wheel odometry", "is not a topic"},
      {"motion_sources.imu.health_topic=/imu/", "is not a topic"},
      {"motion_sources.wio.T_base_source.xyz_m=[1, 0, 0]", "belongs to kind imu alone"},
      {"motion_sources.wio.use_acceleration=off", "belongs to kind imu alone"},
      {"motion_sources.wio.late_ms=251", "is outside -250 .. 250"},
      {"motion_sources.imu.late_ms=.nan", "must be a finite number"},
      {"motion_sources.wio.scale=0", "is outside 0.5 .. 2"},
      {"motion_sources.imu.scale=1.1", "belongs to kind odometry alone"},
      {"motion_sources.imu.yaw_scale=0.9", "belongs to kind odometry alone"},
      {"motion_sources.imu.calibration=maybe", "must be auto | report | off"},
      {"motion_sources.imu.calibration_sigma.late_ms=-1", "is outside 0 .. 250"},
      {"motion_sources.imu.calibration_sigma.mounting_deg=46", "is outside 0 .. 45"},
      {"motion_sources.wio.calibration_sigma.scale=0.6", "is outside 0 .. 0.5"},
      {"motion_sources.wio.calibration_sigma.mounting_deg=1", "belongs to kind imu alone"},
      {"motion_sources.imu.calibration_sigma.scale=0.01", "belongs to kind odometry alone"},
      {"motion.max_speed_mps=0", "is outside 0.1 .. 1000"},
      {"motion.max_acceleration_mps2=.nan", "must be a finite number"},
      {"motion_correction=perhaps", "must be true or false"},
      {"sweep_period_ms=5", "is outside 10 .. 1000"},
      {"sweep_period_ms=-1e300", "is outside 10 .. 1000"},
      {"sweep_period_ms=fast", "must be a finite number, or auto"},
      {"range_m=[-1, 5]", "must be [nearest, farthest]"},
      {"range_m=[0.5, 100, 200]", "must be a list of 2 finite numbers"},
      {"body_box={enabled: true}", "must be greater"},
      {"segment_filter.points=99", "is outside 100 .. 1000000"},
      {"segment_filter.points=many", "or auto"},
      {"voxel_filter.leaf_m=.nan", "must be a finite number"},
      {"voxel_filter.leaf_m=1e999", "must be a finite number"},
      {"voxel_filter.leaf_m=0", "is outside 0.01 .. 10"},
      {"random_filter.keep=1.1", "is outside 0.001 .. 1"},
      {"seed=-1", "0 or more"},
      {"seed=18446744073709551616", "is outside 0 .. 18446744073709551615"},
      {"scan_to_scan.mode=sometimes", "must be always | auto | off"},
      {"scan_to_scan.max_iterations=0", "is outside 1 .. 100"},
      {"scan_to_submap.max_iterations=101", "is outside 1 .. 100"},
      {"scan_to_submap.max_correspondence_m=-0.5", "is outside 0.01 .. 100"},
      {"map.keyframe_m=0", "is outside"},
      {"map.keyframe_deg=181", "is outside 1 .. 180"},
      {"map.max_bytes=999", "is outside"},
      {"flat_ground=maybe", "must be off | on | auto"},
      {"realtime.priority=100", "is outside 0 .. 99"},
      {"realtime.cpus=[-1]", "is outside 0 .. 1023"},
      {"realtime.cpus=0", "must be a list"},
      {"record.max_bytes=9999999", "is outside 10000000 .. "},
      {"record.max_bytes=-1", "must be a whole number"},
      {"dds.domain=233", "is outside 0 .. 232"},
      {"dds.interface=\"\"", "must name a network interface"},
      {"dds.interface=eth0\"/>", "must name a network interface"},
      {"dds.prefix=/locus//", "is not a topic"},
      {"dds.frame_base=odom", "must differ from frame_odom"},
      {"dds.frame_odom=/odom",
       "dds.frame_odom: must be a name without blanks, and without a slash at its beginning; write odom"},
      {"dds.frame_odom=//robot/odom", "; write robot/odom"},
      {"dds.frame_odom='odom '", "; write odom"},
      {"dds.frame_odom=''", "; write odom"},
      {"dds.frame_odom='/ '", "; write odom"},
      {"dds.frame_base=\"base\\tlink\"", "; write baselink"},
      {"dds.frame_base=' base_link'", "dds.frame_base: must be a name without blanks"},
      {"dds.frame_base=''", "; write base_link"},
      {"dds.flat_ground_topic=flat", "is not a topic"},
      {"dds.flat_ground_topic=/imu/data", "'/imu/data' cannot have Bool here and Imu elsewhere"},
      {"motion_sources.wio.topic=/imu/data", "cannot have Imu here and Odometry elsewhere"},
      {"motion_sources.imu.health_topic=/imu/data", "cannot have Bool here and Imu elsewhere"},
      {"lidars.0.name=kernel_drops", "is taken"},
  };
  for (const BadValue& bad : bad_values) {
    const ConfigErrors errors = errors_with({bad.assignment});
    ASSERT_EQ(errors.size(), 1U) << bad.assignment;
    EXPECT_TRUE(errors[0].starts_with("--set " + bad.assignment + ": ")) << errors[0];
    EXPECT_NE(errors[0].find(bad.reason), std::string::npos) << errors[0] << "\nlacks: " << bad.reason;
  }
}

TEST(ConfigYaml, TwoLidarsMayShareAPortOnlyWithAddressesOfTheirOwn) {
  const auto lidars = [](const std::string& first, const std::string& second) {
    return "lidars:\n  - {name: a, source_ip: " + first + "}\n  - {name: b, source_ip: " + second + "}\n";
  };
  EXPECT_TRUE(errors_in(lidars("10.0.0.1", "10.0.0.2")).empty());
  for (const auto& [first, second] :
       {std::pair{"any", "any"}, std::pair{"any", "10.0.0.2"}, std::pair{"10.0.0.2", "10.0.0.2"}}) {
    const ConfigErrors errors = errors_in(lidars(first, second));
    ASSERT_EQ(errors.size(), 1U);
    EXPECT_TRUE(errors[0].starts_with("robot.yaml:3: lidars.1.port: ")) << errors[0];
  }
}

TEST(ConfigYaml, ALidarAndASourceMayNotShareAName) {
  EXPECT_EQ(errors_in("lidars:\n  - name: wio\nmotion_sources:\n  - name: wio\n"),
            ConfigErrors{"robot.yaml:4: motion_sources.0.name: 'wio' is taken, each name may stand once"});
}

TEST(ConfigYaml, MistakesThatQuoteLineBreaksStayOneLine) {
  EXPECT_EQ(errors_in("lidars:\n  - name: \"a\\nb: c\"\n"),
            ConfigErrors{
                "robot.yaml:2: lidars.0.name: 'a b: c' is not a name; write a letter, then letters, digits, _ or -"});
}

TEST(ConfigYaml, OffAndOnAreReadAsWords) {
  EXPECT_EQ(valid(parse_config("flat_ground: on\nscan_to_scan: {mode: off}", "")).odometry.flat_ground, FlatGround::on);
  EXPECT_EQ(valid(parse_config("flat_ground: 'on'", "")).odometry.flat_ground, FlatGround::on);
  EXPECT_EQ(valid(parse_config("flat_ground: true", "")).odometry.flat_ground, FlatGround::on);
  EXPECT_EQ(valid(parse_config("scan_to_scan: {mode: false}", "")).odometry.scan_to_scan_mode, ScanToScanMode::off);
}

/// Regression: it was read as an endless sequence of empty documents, until memory was exhausted.
TEST(ConfigYaml, LeadingCommaIsAnError) {
  EXPECT_EQ(errors_in(",lidars: []\n"), ConfigErrors{"robot.yaml:1: no key begins like this; remove what precedes it"});
}

TEST(ConfigYaml, InvalidYamlIsRejectedWithItsLine) {
  EXPECT_EQ(errors_in("threads: 1\nlidars: [a\n").size(), 1U);
  EXPECT_TRUE(errors_in("threads: 1\nlidars: ]\n")[0].starts_with("robot.yaml:2: not YAML: "));
  EXPECT_TRUE(errors_in(std::string(100'000, '['))[0].starts_with("robot.yaml:1: not YAML: "));
  EXPECT_EQ(errors_in("just words"), ConfigErrors{"robot.yaml:1: must be a section of keys"});
  EXPECT_EQ(errors_in("? [a, b]\n: c\n"), ConfigErrors{"robot.yaml:1: a key must be a word"});
  EXPECT_EQ(errors_in("---\nthreads: 1\n---\nthreads: 2\n"),
            ConfigErrors{"robot.yaml:3: a second YAML document begins; keep one, and begin every top-level key in "
                         "the first column"});
}

/// Error messages must not contain terms of the YAML grammar.
TEST(ConfigYaml, IndentationErrorsAreExplainedPlainly) {
  const auto said = [](const std::string& yaml, const std::string& where, const std::string& what) {
    const ConfigErrors errors = errors_in(yaml);
    ASSERT_EQ(errors.size(), 1U);
    EXPECT_TRUE(errors[0].starts_with(where)) << errors[0];
    EXPECT_NE(errors[0].find(what), std::string::npos) << errors[0];
  };
  said("lidars:\n  - name: front\n   port: 3\n", "robot.yaml:3: ", "is not indented like the lines it belongs to");
  said("map:\n    keyframe_m: 1\n  keyframe_deg: 3\n",
       "robot.yaml:3: ", "is not indented like the lines it belongs to");
  said("map:\n  keyframe_m: 1\n   keyframe_deg: 2\n", "robot.yaml:3: ", "a key is not possible here");
  said("map:\n  keyframe_m:1\n  keyframe_deg: 2\n", "robot.yaml:3: ", "a missing colon or space after it");
  said("map:\n\tkeyframe_m: 1\n", "robot.yaml:2: ", "is indented by a tab; use spaces");
  said("lidars:\n- {name: front, port: 3\nthreads: 2\n", "robot.yaml:3: ", "a { before this line is not closed");
  said("range_m: [1, 2\nthreads: 2\n", "robot.yaml:2: ", "a [ before this line is not closed");
  said("threads: @2\n", "robot.yaml:1: ", "quote it");
}

TEST(ConfigYaml, DamagedFilesGiveOnePrintableLinePerMistakeAndNeverCrash) {
  std::mt19937 random{7};
  const std::string intact = print_config(Config{});
  int refused = 0;
  for (int i = 0; i < 2000; ++i) {
    std::string text = intact;
    for (unsigned damage = 0; damage <= random() % 8; ++damage)
      text[random() % text.size()] = static_cast<char>(random());
    text.resize(i % 2 == 0 ? text.size() : random() % text.size());
    for (const std::string& error : errors_in(text)) {
      ++refused;
      EXPECT_TRUE(error.starts_with("robot.yaml:"));
      EXPECT_TRUE(std::none_of(error.begin(), error.end(), [](unsigned char c) { return std::iscntrl(c) != 0; }));
    }
  }
  EXPECT_GT(refused, 1000);
}

TEST(ConfigYaml, UnreadableFileIsNamed) {
  const auto error_of = [](const std::string& file) { return errors_of(load_config(file)).at(0); };
  EXPECT_TRUE(error_of("/nowhere/robot.yaml").starts_with("/nowhere/robot.yaml: cannot be read"));
  EXPECT_TRUE(error_of(testing::TempDir()).starts_with(testing::TempDir() + ": cannot be read"));
  EXPECT_TRUE(error_of("/dev/zero").starts_with("/dev/zero: is longer than 1 MiB"));
}

TEST(ConfigYaml, FileReadsTheSameAsItsText) {
  const test::TemporaryFile file{"robot.yaml", test::bytes_of(kAllChanged)};
  EXPECT_EQ(valid(load_config(file.path())), valid(parse_config(kAllChanged, "")));
}

TEST(ConfigYaml, ServiceFileMustNameALidarUnlessExempt) {
  const auto errors_of_file = [](const std::string& text) {
    return errors_of(load_service_config(test::TemporaryFile{"robot.yaml", test::bytes_of(text)}.path()));
  };
  for (const char* text : {"", "# locusd.yaml\n", "version: 1\n", "dds: {interface: eth0}\n", "defaults: false\n"}) {
    const ConfigErrors errors = errors_of_file(text);
    ASSERT_EQ(errors.size(), 1U) << text;
    EXPECT_NE(errors[0].find("robot.yaml:1: names no lidar"), std::string::npos) << errors[0];
  }
  EXPECT_EQ(errors_of_file("lidars: [{}]\n"), ConfigErrors{});
  EXPECT_EQ(errors_of_file("defaults: true\n"), ConfigErrors{});
  EXPECT_EQ(errors_of_file(kAllChanged), ConfigErrors{});
  EXPECT_NE(errors_of_file("threads: 0\n").at(0).find("threads"), std::string::npos) << "what is wrong comes first";
  EXPECT_FALSE(load_service_config("/nowhere/robot.yaml"));
}

/// A disk that is full, or a crash, while a file is written: the rest of it would be the defaults.
TEST(ConfigYaml, ServiceFileCutByAnInterruptedWriteIsRejected) {
  const auto errors_of_file = [](const std::string& text) {
    return errors_of(load_service_config(test::TemporaryFile{"robot.yaml", test::bytes_of(text)}.path()));
  };
  const std::string lidars = "lidars: [{}]\n", dds = "dds: {interface: wlan0}";
  const std::string text = lidars + "# " + std::string(4100, 'x') + "\n" + dds;
  const ConfigErrors errors = errors_of_file(text.substr(0, 4096));
  ASSERT_EQ(errors.size(), 1U);
  EXPECT_NE(errors[0].find("robot.yaml:2: ends within a line after 4096 bytes"), std::string::npos) << errors[0];
  EXPECT_EQ(errors_of_file(text), ConfigErrors{}) << "complete, without a line break at its end";
  EXPECT_EQ(errors_of_file(lidars + dds), ConfigErrors{});
  const std::string filler(8192 - lidars.size() - dds.size() - 2, '#');
  EXPECT_EQ(errors_of_file(lidars + filler + "\n" + dds + "\n"), ConfigErrors{}) << "8192 bytes of whole lines";
}

TEST(ConfigYaml, AnotherVersionIsAnError) {
  ASSERT_EQ(errors_in("version: 2\n").size(), 1U);
  EXPECT_TRUE(errors_in("version: 2\n")[0].starts_with("robot.yaml:1: version: this locusd reads version 1; see"));
}

TEST(ConfigYaml, RecordingDoesNotLeaveItsFolder) {
  for (const char* folder : {"../../etc", "runs/../../etc", "..", "/var/lib/../etc"})
    EXPECT_EQ(errors_in(std::string{"record: {folder: "} + folder + "}\n").size(), 1U) << folder;
  for (const char* folder : {"record", "/data/drives", "a..b", "runs/today"})
    EXPECT_EQ(errors_in(std::string{"record: {folder: "} + folder + "}\n").size(), 0U) << folder;
  for (const char* right : {"keep_s: 0", "keep_s: 1", "keep_s: 600", "keep_bytes: 20000000, incidents_bytes: 20000000"})
    EXPECT_EQ(errors_in(std::string{"record: {"} + right + "}\n").size(), 0U) << right;
  for (const char* wrong :
       {"keep_s: 0.5", "keep_s: -1", "keep_s: 601", "keep_s: .nan", "keep_bytes: 20000000, incidents_bytes: 19999999"})
    EXPECT_EQ(errors_in(std::string{"record: {"} + wrong + "}\n").size(), 1U) << wrong;
}

TEST(ConfigOverride, ListItemsAreFoundByNameAndByIndex) {
  const Config config = with(Config{}, {"lidars.front.port=2369", "lidars.0.T_base_lidar.xyz_m=[0, 0, 1]"});
  EXPECT_EQ(config.lidars[0].port, 2369);
  EXPECT_EQ(config.lidars[0].T_base_lidar.translation.z(), 1.0);
}

TEST(ConfigOverride, PartOfASectionLeavesTheRestOfIt) {
  const Config config = with(Config{}, {"map={keyframe_m: 3}"});
  EXPECT_EQ(config.odometry.map, (MapOptions{3.0, MapOptions{}.keyframe_deg, MapOptions{}.max_bytes}));
}

TEST(ConfigOverride, PartsOfASectionMayFollowTheSection) {
  const Config config = with(Config{}, {"map={}", "map={keyframe_m: 3}", "map.keyframe_deg=4"});
  EXPECT_EQ(config.odometry.map, (MapOptions{3.0, 4.0, MapOptions{}.max_bytes}));
}

TEST(ConfigOverride, OptionsTakeEffectTogetherAndTheLastOneWins) {
  const Config config = with(Config{}, {"range_m=[0.5, 2]", "threads=3", "range_m=[3, 9]", "threads=1"});
  EXPECT_EQ(config.sweep.min_range_m, 3.0);
  EXPECT_EQ(config.odometry.threads, 1);
}

TEST(ConfigOverride, MistakesNameTheOptionAtFault) {
  EXPECT_EQ(errors_with({"threads=4", "lidars.frnt.port=1", "voxel.leaf_m=1", "threads.max=2", "threads", "map=[1"}),
            (ConfigErrors{
                "--set lidars.frnt.port=1: lidars has no item 'frnt'; use a name or an index below 1",
                "--set voxel.leaf_m=1: voxel: unknown key; the nearest known one is 'voxel_filter'",
                "--set threads.max=2: threads has no keys below it",
                "--set threads: must be KEY=VALUE, e.g. lidars.front.port=2369",
                "--set map=[1: the value is not YAML",
            }));
  EXPECT_EQ(errors_with({"threads=0", "map={keyframes: 1}", "seed=2"}),
            (ConfigErrors{
                "--set map={keyframes: 1}: map.keyframes: unknown key; the nearest known one is 'keyframe_m'",
                "--set threads=0: threads: 0 is outside 1 .. 256",
            }));
}

TEST(ConfigSha256, IsTheDigestOfThePrintedText) {
  // Independent check of the digest by the tool of the same name.
  const test::TemporaryFile file{"printed.yaml", test::bytes_of(print_config(Config{}))};
  FILE* pipe = popen(("sha256sum " + file.path().string()).c_str(), "r");
  ASSERT_NE(pipe, nullptr);
  std::string digest(64, '\0');
  const std::size_t read = fread(digest.data(), 1, digest.size(), pipe);
  pclose(pipe);
  ASSERT_EQ(read, digest.size());
  EXPECT_EQ(config_sha256(Config{}), digest);
}

} // namespace
} // namespace locus
