// SPDX-License-Identifier: Apache-2.0
#include "daemon/calibration.hpp"

#include <limits>
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "config/config_yaml.hpp"
#include "core/base/pose.hpp"

namespace locus::daemon {
namespace {

/// A precisely calibrated gyro: sigma 0.1 ms and 0.1 degrees.
LearnedSource gyro(double late_s, const Eigen::Vector3d& mounting_deg) {
  LearnedSource learned;
  learned.states[LearnedSource::kLate] = late_s;
  learned.states.segment<3>(LearnedSource::kMounting) = kRadPerDeg * mounting_deg;
  learned.covariance.diagonal().setConstant(1e-8);
  learned.covariance.diagonal().segment<3>(LearnedSource::kMounting).setConstant(0.01 * kRadPerDeg * kRadPerDeg);
  return learned;
}

std::string doubt(SourceKind kind, const LearnedSource& learned) {
  Config config;
  config.motion_sources = {{{"source", kind, {}}, "", ""}};
  Figures figures{.config = config};
  figures.sweeps.last.emplace().sources[0].learned = learned;
  return calibration_warning(figures, 0);
}
std::string doubt_of_gyro(double late_s, const Eigen::Vector3d& mounting_deg = {0, 0, 0}) {
  return doubt(SourceKind::imu, gyro(late_s, mounting_deg));
}

TEST(Calibration, GrossErrorIsReportedWithItsSize) {
  EXPECT_NE(doubt_of_gyro(0.04).find("more than 30 ms later than lidar"), std::string::npos);
  EXPECT_NE(doubt_of_gyro(-0.04).find("40 ms earlier than lidar"), std::string::npos);
  EXPECT_NE(doubt_of_gyro(0, {4, 0, 0}).find("+4.0 degrees about x (roll)"), std::string::npos);
  EXPECT_NE(doubt_of_gyro(0, {0, -4, 0}).find("-4.0 degrees about y (pitch)"), std::string::npos);
  EXPECT_NE(doubt_of_gyro(0, {0, 0, 90}).find("+90.0 degrees about z (yaw)"), std::string::npos);
}

TEST(Calibration, ExchangedAxesAreReportedWithTheMountingToConfigure) {
  Config config;
  config.motion_sources = {{{"source", SourceKind::imu, {}}, "", ""}};
  config.motion_sources[0].T_base_source.rotation = from_rpy_rad({0, 0, -90 * kRadPerDeg});
  Figures figures{.config = config};
  const Eigen::Matrix3d half_turn = Eigen::Vector3d{-1, -1, 1}.asDiagonal(),
                        mirrored = Eigen::Vector3d{1, -1, 1}.asDiagonal();
  figures.ingest.sources[0].gyro_axes = half_turn;
  EXPECT_NE(calibration_warning(figures, 0).find("T_base_source.rpy_deg: [0, 0, 90]"), std::string::npos)
      << calibration_warning(figures, 0);
  figures.ingest.sources[0].gyro_axes = mirrored;
  EXPECT_NE(calibration_warning(figures, 0).find("its driver"), std::string::npos) << calibration_warning(figures, 0);
}

TEST(Calibration, SmallErrorIsNotReported) {
  EXPECT_EQ(doubt_of_gyro(0.014, {2.9, -2.9, 2.9}), "");
  EXPECT_EQ(doubt_of_gyro(-0.029), "");
  EXPECT_EQ(doubt_of_gyro(0.029, {0, 0, 5}), "") << "a mounting that was measured late is no mounting";
}

TEST(Calibration, UncertainErrorIsNotReported) {
  LearnedSource unsure = gyro(0.04, {10, 0, 0});
  unsure.covariance *= 1e4;
  EXPECT_EQ(doubt(SourceKind::imu, unsure), "");
  LearnedSource absurd = gyro(std::numeric_limits<double>::quiet_NaN(), {0, 0, 0});
  EXPECT_EQ(doubt(SourceKind::imu, absurd), "");
  Config config;
  EXPECT_EQ(calibration_warning(Figures{.config = config}, 0), "") << "no sweep yet";
}

/// Odometry has other states: a scale error of 4 % must not be reported as lateness.
TEST(Calibration, ScaleErrorOfAnOdometryIsNotReportedAsLateness) {
  EXPECT_EQ(doubt(SourceKind::odometry, gyro(0.04, {10, 0, 0})), "");
}

MotionSourceOptions named(const char* name, SourceKind kind, const CalibrationSigma& sigma = {}) {
  MotionSourceOptions source;
  source.name = name;
  source.kind = kind;
  source.calibration_sigma = sigma;
  return source;
}

const MotionSourceOptions kWio = named("wio", SourceKind::odometry);

MotionSourceOptions imu_turned(const Eigen::Vector3d& rpy_deg) {
  MotionSourceOptions source = named("imu", SourceKind::imu);
  source.T_base_source = {from_rpy_rad(rpy_deg * kRadPerDeg), {0.1, 0.2, 0.3}};
  return source;
}

LearnedSource wheels(double scale, double yaw_scale, double sigma) {
  LearnedSource learned;
  learned.states[LearnedSource::kScale] = scale - 1.0;
  learned.states[LearnedSource::kYawScale] = yaw_scale - 1.0;
  learned.covariance.diagonal().setConstant(sigma * sigma);
  return learned;
}

TEST(Calibration, FiguresAreListedWithDeviationsAndConfiguration) {
  const nlohmann::json of_gyro = learned_json(imu_turned({0, 0, 0}), gyro(0.005, {1, 2, -3}));
  EXPECT_DOUBLE_EQ(of_gyro["late_ms"]["value"], 5.0);
  EXPECT_DOUBLE_EQ(of_gyro["late_ms"]["sd"], 0.1);
  EXPECT_DOUBLE_EQ(of_gyro["late_ms"]["configured"], 0.0);
  EXPECT_DOUBLE_EQ(of_gyro["late_ms"]["configured_sd"], 15.0);
  EXPECT_DOUBLE_EQ(of_gyro["mounting_deg"]["value"][2], -3.0);
  EXPECT_DOUBLE_EQ(of_gyro["mounting_deg"]["sd"][0], 0.1);
  MotionSourceOptions wio = named("wio", SourceKind::odometry, {.scale = 0.05});
  wio.scale = 1.02;
  const nlohmann::json of_wheels = learned_json(wio, wheels(1.01, 0.98, 0.001));
  EXPECT_DOUBLE_EQ(of_wheels["scale"]["value"], 1.01);
  EXPECT_DOUBLE_EQ(of_wheels["scale"]["configured"], 1.02);
  EXPECT_DOUBLE_EQ(of_wheels["scale"]["configured_sd"], 0.05);
  EXPECT_DOUBLE_EQ(of_wheels["yaw_scale"]["value"], 0.98);
}

OdometryFindings findings(double late_s, const Eigen::Vector3d& lidar_turn_deg) {
  OdometryFindings found{.late_s = {late_s, 1e-4}};
  for (int axis = 0; axis < 3; ++axis)
    found.lidar_turn_rad[static_cast<std::size_t>(axis)] = {lidar_turn_deg[axis] * kRadPerDeg, 0.1 * kRadPerDeg};
  return found;
}

/// Figures after a comparison of wheels with lidar, with an IMU of this mounting error.
struct Compared {
  Config config;
  Figures figures{.config = config};

  explicit Compared(const OdometryFindings& found, const Eigen::Vector3d& imu_turn_deg = {0, 0, 0}) {
    figures.sweeps.compared[0] = found; // of wio; the other source is the IMU
    figures.sweeps.last.emplace().sources[1].learned = gyro(0, imu_turn_deg);
  }
};

TEST(Calibration, LatenessOfAnOdometryIsReportedAndListed) {
  Compared compared(findings(0.04, {0, 0, 0}));
  EXPECT_NE(calibration_warning(compared.figures, 0).find("40 ms later than lidar does; make"), std::string::npos);
  EXPECT_NE(calibration_warning(compared.figures, 0).find("late_ms: 40"), std::string::npos);
  const nlohmann::json json = learned_json(kWio, wheels(1, 1, 0.001), false, findings_on(compared.figures, 0));
  EXPECT_DOUBLE_EQ(json["late_ms"]["value"], 40.0);
  EXPECT_DOUBLE_EQ(json["late_ms"]["configured"], 0.0);
  EXPECT_DOUBLE_EQ(json["calibrated"]["late_ms"], 40.0);
  compared.config.motion_sources[0].late_ms = 10.0;
  EXPECT_NEAR(findings_on(compared.figures, 0)->late_s.mean, 0.05, 1e-9) << "10 ms are subtracted already";
  compared.config.motion_sources[0].calibration = Calibration::off;
  EXPECT_EQ(calibration_warning(compared.figures, 0), "");
}

TEST(Calibration, LatenessThatADriveDoesNotDetermineStaysAsConfigured) {
  MotionSourceOptions wio = kWio;
  wio.late_ms = 30.0;
  const OdometryFindings unknown;
  EXPECT_EQ(calibrated(wio, wheels(1, 1, 0.001), unknown), wio);
  const nlohmann::json json = learned_json(wio, wheels(1, 1, 0.001), false, unknown);
  EXPECT_DOUBLE_EQ(json["late_ms"]["value"], 30.0);
}

/// With a gyro the estimator does not use the yaw of wheels.
TEST(Calibration, YawScaleIsThatOfTheComparisonWhereTheEstimatorHasNone) {
  OdometryFindings found = findings(0, {0, 0, 0});
  found.yaw_scale = {-0.15, 0.002};
  LearnedSource learned = as_configured(kWio);
  EXPECT_DOUBLE_EQ(calibrated(kWio, learned, found).yaw_scale, 0.85);
  EXPECT_DOUBLE_EQ(calibrated(kWio, wheels(1, 0.95, 0.001), found).yaw_scale, 0.95) << "more certain";
}

TEST(Calibration, TiltedLidarIsReportedInsteadOfTheImu) {
  const Compared tilted(findings(0, {0, 4, 0}), {0, -4, 0});
  const std::string warning = lidar_mounting_warning(tilted.figures);
  EXPECT_NE(warning.find("lidar front is rotated by +4.0 degrees about y (pitch)"), std::string::npos) << warning;
  EXPECT_NE(warning.find("wio"), std::string::npos);
  EXPECT_EQ(calibration_warning(tilted.figures, 1), "");
  EXPECT_EQ(lidar_mounting_warning(Compared(findings(0, {1.5, -1.5, 1.5})).figures), "");
  const Compared imu(findings(0, {0, 0, 0}), {0, -4, 0});
  EXPECT_EQ(lidar_mounting_warning(imu.figures), "");
  EXPECT_NE(calibration_warning(imu.figures, 1), "");
}

TEST(Calibration, RotationOfALidarIsListedAndWritten) {
  LidarOptions lidar;
  lidar.T_base_lidar = {from_rpy_rad({0, 0, 90 * kRadPerDeg}), {0, 0, 0.8}};
  const Compared tilted(findings(0, {0, 4, 0.1}));
  const auto turn = turn_of_lidars(tilted.config.motion_sources, tilted.figures.sweeps.compared);
  ASSERT_TRUE(turn);
  const nlohmann::ordered_json lidars{{"front", {{"learned", learned_json(lidar, *turn)}}}};
  const std::string yaml = calibration_yaml(nlohmann::ordered_json::object(), lidars);
  EXPECT_EQ(yaml,
            "# For the entries of the same name.\nlidars:\n  - name: front\n"
            "    T_base_lidar: {xyz_m: [0, 0, 0.8], rpy_deg: [4, 0, 90]} # sd 0.1, 0.1, 0.1 degrees about x, y, z "
            "of base\n");
  EXPECT_TRUE(parse_config("version: 1\ndefaults: true\n" + yaml, "pasted"));
  EXPECT_NE(calibration_text(nlohmann::ordered_json::object(), lidars).find("4 +- 0.1  better known than configured"),
            std::string::npos);
}

/// The learned rotation is in the base frame, composed with the configured one.
TEST(Calibration, BetterKnownValuesReplaceTheConfiguredOnes) {
  const MotionSourceOptions imu = calibrated(imu_turned({0, 0, 90}), gyro(0.034, {5, 0, 0}));
  EXPECT_DOUBLE_EQ(imu.late_ms, 34.0);
  const Eigen::Quaterniond expected =
      from_rpy_rad(Eigen::Vector3d{5, 0, 0} * kRadPerDeg) * from_rpy_rad(Eigen::Vector3d{0, 0, 90} * kRadPerDeg);
  EXPECT_LT(imu.T_base_source.rotation.angularDistance(expected), 1e-7);
  EXPECT_EQ(imu.T_base_source.translation, (Eigen::Vector3d{0.1, 0.2, 0.3}));
  const MotionSourceOptions wio = calibrated(kWio, wheels(1.01, 0.95, 0.001));
  EXPECT_DOUBLE_EQ(wio.scale, 1.01);
  EXPECT_DOUBLE_EQ(wio.yaw_scale, 0.95);
}

TEST(Calibration, OtherValuesRemainAsConfigured) {
  const MotionSourceOptions imu = imu_turned({1, 2, 3});
  EXPECT_EQ(calibrated(imu, gyro(0.0002, {0.2, -0.2, 0.2})), imu) << "within three deviations";
  LearnedSource unsure = gyro(0.1, {30, 0, 0});
  unsure.covariance *= 1e6;
  EXPECT_EQ(calibrated(imu, unsure), imu) << "less sure than the configuration";
  LearnedSource absurd = gyro(std::numeric_limits<double>::quiet_NaN(), {0, 0, 0});
  EXPECT_EQ(calibrated(imu, absurd), imu);
  const MotionSourceOptions sure = named("wio", SourceKind::odometry, {.scale = 0.0, .yaw_scale = 0.0});
  EXPECT_EQ(calibrated(sure, wheels(1.01, 1.0, 0.0)), sure);
}

nlohmann::ordered_json sources_of(const MotionSourceOptions& source, const LearnedSource& learned) {
  return {{source.name, {{"learned", learned_json(source, learned)}}}};
}

TEST(Calibration, YamlIsValidConfiguration) {
  const std::string yaml = calibration_yaml(sources_of(imu_turned({0, 0, 90}), gyro(-0.034, {0, 5, 0})));
  EXPECT_EQ(yaml,
            "# For the entries of the same name.\nmotion_sources:\n"
            "  - name: imu\n    kind: imu\n"
            "    late_ms: -34 # sd 0.1\n"
            "    T_base_source: {xyz_m: [0.1, 0.2, 0.3], rpy_deg: [5, 0, 90]} # sd 0.1, 0.1, 0.1 degrees about x, "
            "y, z of base\n");
  const auto read = parse_config("version: 1\ndefaults: true\n" + yaml, "pasted");
  ASSERT_TRUE(read) << read.error().front();
  EXPECT_DOUBLE_EQ(read->motion_sources[0].late_ms, -34.0);
  const std::string nothing = "# No learned value is better known than the configured one.\n";
  EXPECT_EQ(calibration_yaml(sources_of(imu_turned({0, 0, 0}), gyro(0, {0, 0, 0}))), nothing);
  EXPECT_EQ(calibration_yaml(nlohmann::ordered_json::object()), nothing) << "no source at all";
}

/// A drive de-skews points before the samples of their time arrive, so it cannot estimate such a lateness.
TEST(Calibration, TooLateSourceIsNotCalibratedFromADrive) {
  const MotionSourceOptions imu = imu_turned({0, 0, 0});
  const LearnedSource late = gyro(0.017, {0, 5, 0});
  const nlohmann::ordered_json of_drive = sources_of(imu, late);
  EXPECT_EQ(calibration_yaml(of_drive), "# imu arrives too late for a calibration during a drive; calibrate it from a "
                                        "recording:\n# locus-replay --calibrate FILE RECORDING\n"
                                        "# No learned value is better known than the configured one.\n");
  EXPECT_NE(calibration_text(of_drive).find("17 +- 0.1  too late to calibrate during a drive"), std::string::npos);
  const nlohmann::ordered_json in_time = {{"imu", {{"learned", learned_json(imu, late, true)}}}};
  EXPECT_NE(calibration_yaml(in_time).find("late_ms: 17"), std::string::npos);
  EXPECT_NE(calibration_yaml(sources_of(imu, gyro(0.014, {0, 5, 0}))).find("late_ms: 14"), std::string::npos);
}

TEST(Calibration, TableMarksUnobservedFigures) {
  LearnedSource learned = gyro(-0.034, {0, 0, 0.1});
  learned.covariance(LearnedSource::kMounting, LearnedSource::kMounting) = 1e-2;
  const std::string text = calibration_text(sources_of(imu_turned({0, 0, 0}), learned));
  EXPECT_NE(text.find("-34 +- 0.1  better known than configured"), std::string::npos) << text;
  EXPECT_NE(text.find("not observed by the drives so far"), std::string::npos) << text;
  EXPECT_NE(text.find("0.1 +- 0.1  as configured"), std::string::npos) << text;
  EXPECT_NE(text.find("since 1970"), std::string::npos) << text;
  EXPECT_EQ(calibration_text(nlohmann::ordered_json::object()),
            "No motion source that calibrates itself has been received.\n");
}

/// Values that the user has configured are not reported.
TEST(Calibration, ConfiguredLatenessIsNotReported) {
  Config config;
  config.motion_sources = {{imu_turned({0, 0, 0}), "", ""}};
  config.motion_sources[0].late_ms = 38;
  Figures figures{.config = config};
  figures.sweeps.last.emplace().sources[0].learned = gyro(0.04, {0, 0, 0});
  EXPECT_EQ(calibration_warning(figures, 0), "");
  figures.sweeps.last->sources[0].learned = gyro(0.09, {0, 0, 0});
  EXPECT_NE(calibration_warning(figures, 0).find("30 ms later than lidar does on top of late_ms"), std::string::npos);
  EXPECT_NE(calibration_warning(figures, 0).find("locus-replay --calibrate"), std::string::npos);
  figures.sweeps.last->sources[0].learned = gyro(-0.04, {0, 0, 0});
  EXPECT_NE(calibration_warning(figures, 0).find("late_ms: -40"), std::string::npos);
}

} // namespace
} // namespace locus::daemon
