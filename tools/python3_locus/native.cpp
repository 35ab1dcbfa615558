// SPDX-License-Identifier: Apache-2.0
#include <chrono>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "arrays.hpp"
#include "liblocus.hpp"

namespace locus_python {
namespace {

using liblocus::Estimate, liblocus::SourceEstimate, liblocus::Surface;
using File = std::optional<std::filesystem::path>;
using Settings = std::vector<std::string>;
using Text = const char*;

/// Object of the library shared by several Python threads: calls are serialised, and wait and compute without the GIL.
template <class Object> class Shared {
 public:
  template <class... Arguments>
  explicit Shared(Arguments&&... arguments) : object_(std::forward<Arguments>(arguments)...) {}

  template <class Work> auto compute(const Work& work) {
    const py::gil_scoped_release without_interpreter;
    const std::scoped_lock lock(mutex_);
    return work(object_);
  }

 private:
  std::mutex mutex_;
  Object object_;
};
using Odometry = Shared<liblocus::Odometry>;
using Replay = Shared<liblocus::Replay>;

std::vector<Estimate> packet(Odometry& odometry, const py::buffer& payload, std::int64_t arrival_ns, std::uint16_t port,
                             const std::variant<std::uint32_t, std::string>& source_ip) {
  const Bytes bytes(payload);
  const auto* const text = std::get_if<std::string>(&source_ip);
  const std::uint32_t ip = text != nullptr ? liblocus::parse_ip(*text) : std::get<std::uint32_t>(source_ip);
  return odometry.compute([&](auto& object) { return object.packet(bytes.span(), arrival_ns, port, ip); });
}

std::vector<Estimate> cloud(Odometry& odometry, const std::string& lidar, const Input<float>& xyz,
                            std::int64_t stamp_ns, std::optional<std::int64_t> arrival_ns,
                            const std::optional<Input<double>>& time, const std::optional<Input<std::uint16_t>>& ring,
                            const std::optional<Input<float>>& intensity) {
  if (xyz.ndim() != 2 || xyz.shape(1) != 3)
    throw liblocus::Error("cloud: xyz must have the shape (n, 3)");
  liblocus::Cloud cloud{.stamp_ns = stamp_ns, .arrival_ns = arrival_ns.value_or(stamp_ns), .xyz_m = span_of(xyz)};
  if (time)
    cloud.time_s = span_of(*time);
  if (ring)
    cloud.ring = span_of(*ring);
  if (intensity)
    cloud.intensity = span_of(*intensity);
  return odometry.compute([&](auto& object) { return object.cloud(lidar, cloud); });
}

std::vector<Estimate> imu(Odometry& odometry, const std::string& source, std::int64_t stamp_ns,
                          const Input<double>& angular_velocity, const Input<double>& specific_force,
                          const std::optional<Input<double>>& orientation_xyzw,
                          std::optional<std::int64_t> arrival_ns) {
  liblocus::ImuSample sample{.stamp_ns = stamp_ns,
                             .arrival_ns = arrival_ns.value_or(stamp_ns),
                             .angular_velocity_radps = numbers_of<3>("imu: angular_velocity", angular_velocity),
                             .specific_force_mps2 = numbers_of<3>("imu: specific_force", specific_force)};
  if (orientation_xyzw)
    sample.orientation_xyzw = numbers_of<4>("imu: orientation_xyzw", *orientation_xyzw);
  return odometry.compute([&](auto& object) { return object.imu(source, sample); });
}

std::vector<Estimate> odometry(Odometry& odometry, const std::string& source, std::int64_t stamp_ns,
                               const Input<double>& position, const Input<double>& orientation_xyzw,
                               double covariance_scale, std::optional<std::int64_t> arrival_ns) {
  const liblocus::OdometrySample sample{.stamp_ns = stamp_ns,
                                        .arrival_ns = arrival_ns.value_or(stamp_ns),
                                        .position_m = numbers_of<3>("odometry: position", position),
                                        .orientation_xyzw =
                                            numbers_of<4>("odometry: orientation_xyzw", orientation_xyzw),
                                        .covariance_scale = covariance_scale};
  return odometry.compute([&](auto& object) { return object.odometry(source, sample); });
}

std::chrono::nanoseconds duration_of(Text name, double seconds) {
  constexpr double kMost_s = 1e9, kPerSecond = 1e9;
  if (!(std::abs(seconds) < kMost_s))
    throw liblocus::Error(std::string{name} + ": pass a number of seconds");
  return std::chrono::nanoseconds{std::llround(seconds * kPerSecond)};
}

std::unique_ptr<Replay> replay(const std::filesystem::path& path, const File& config, const Settings& set,
                               std::optional<double> start, std::optional<double> duration) {
  liblocus::ReplayOptions options{.yaml_file = config.value_or(""), .overrides = set};
  if (start)
    options.start = duration_of("start", *start);
  if (duration)
    options.duration = duration_of("duration", *duration);
  const py::gil_scoped_release without_interpreter;
  return std::make_unique<Replay>(path, options);
}

Estimate next(Replay& replay) {
  std::optional<Estimate> estimate = replay.compute([](auto& object) { return object.next(); });
  if (!estimate)
    throw py::stop_iteration();
  return *std::move(estimate);
}

/// Adds the methods common to Odometry and Replay.
template <class Class> void add_views(Class& definition) {
  using Object = typename Class::type;
  definition
      .def(
          "scan", [](Object& shared) { return points_of(shared.compute([](auto& object) { return object.scan(); })); },
          "The points of the last processed sweep, corrected for motion: float32 (n, 3), metres, frame base at its "
          "end.")
      .def(
          "map", [](Object& shared) { return surfaces_of(shared.compute([](auto& object) { return object.map(); })); },
          "The map, a surface for each voxel of half a metre: float32 (n, 6), x, y, z in metres and the unit normal\n"
          "(0, 0, 0 where unknown), frame odom.")
      .def(
          "figures_json",
          [](Object& shared) { return shared.compute([](auto& object) { return object.figures_json(); }); },
          "Counters of packets, clouds, sources and sweeps so far: JSON as in summary.json of locus-replay.");
}

template <class Class, class Array>
void add_vector(Class& definition, Text name, Array Class::type::*array, Text documentation) {
  definition.def_property_readonly(
      name, [array](const typename Class::type& object) { return vector_of(object.*array); }, documentation);
}
template <class Class, class Array>
void add_matrix(Class& definition, Text name, Array Class::type::*array, Text documentation) {
  definition.def_property_readonly(
      name, [array](const typename Class::type& object) { return matrix_of(object.*array); }, documentation);
}

void define_source_estimate(py::module_& module) {
  py::class_<SourceEstimate> source(module, "SourceEstimate", py::is_final(),
                                    "Role of a motion source in an estimate.");
  source.def_readonly("name", &SourceEstimate::name, "Name in the configuration.");
  add_vector(source, "innovation", &SourceEstimate::innovation,
             "float64 (6,): m/s and rad/s along the axes of base, its motion minus that of all others.");
  add_vector(source, "innovation_sigma", &SourceEstimate::innovation_sigma,
             "float64 (6,): expected standard deviation of the innovation; 0 before the first.");
  source
      .def_readonly("test_ratio", &SourceEstimate::test_ratio,
                    "Normalised innovation; above 1 it contradicts all others.")
      .def_readonly("last_used_ns", &SourceEstimate::last_used_ns, "End of the last sweep that used it; 0: never.")
      .def_readonly("doubted", &SourceEstimate::doubted, "It was not healthy.");
}

void define_estimate(py::module_& module) {
  py::class_<Estimate> estimate(module, "Estimate", py::is_final(),
                                "Pose and twist at the end of a sweep, with their covariances.");
  estimate.def_readonly("stamp_ns", &Estimate::stamp_ns, "End of the sweep, nanoseconds since 1970.");
  add_vector(estimate, "position", &Estimate::position_m, "float64 (3,): metres, of base in odom.");
  add_vector(estimate, "orientation_xyzw", &Estimate::orientation_xyzw, "float64 (4,): unit quaternion, base to odom.");
  add_matrix(estimate, "pose_covariance", &Estimate::pose_covariance,
             "float64 (6, 6): of x, y, z (m) and rotations (rad) about the axes of odom; since the start.");
  add_vector(estimate, "twist", &Estimate::twist, "float64 (6,): m/s along and rad/s about x, y, z of base.");
  add_matrix(estimate, "twist_covariance", &Estimate::twist_covariance, "float64 (6, 6): of the twist.");
  add_vector(estimate, "observability", &Estimate::observability,
             "float64 (6,): observability by lidar of x, y, z, roll, pitch, yaw of base, from 0 to 1.");
  estimate
      .def_property_readonly(
          "state", [](const Estimate& object) { return std::string(name_of(object.state)); },
          "\"tracking\", \"degenerate\", \"dead_reckoning\" or \"standstill\".")
      .def_readonly("prior", &Estimate::prior,
                    "Source of the prior of the registration: \"wio\", \"imu+wio\", \"identity\".")
      .def_readonly("points", &Estimate::points, "Number of registered points.")
      .def_readonly("iterations", &Estimate::iterations, "Iterations of the registration with the map.")
      .def_readonly("inliers", &Estimate::inliers, "Points with a correspondence in the map.")
      .def_readonly("keyframe", &Estimate::keyframe, "The sweep was inserted into the map.")
      .def_readonly("failed", &Estimate::failed, "The registration was rejected: the pose is the prediction.")
      .def_property_readonly(
          "sources", [](const Estimate& object) { return object.sources; },
          "A list of SourceEstimate, in the order of the configuration.")
      .def("__repr__", [](const Estimate& object) {
        return py::str("<locus.Estimate {} at {} ns, position {}>")
            .format(std::string(name_of(object.state)), object.stamp_ns, vector_of(object.position_m));
      });
}

constexpr Text kOdometry =
    "Odometry of inputs that the caller passes in the order of their arrival.\n\n"
    "config: a file as locusd.yaml(5) describes it; None: the defaults, one lidar on port 2368.\n"
    "set: changes to it, as --set of locus-replay, for example [\"lidars.front.model=VLP-16\"].\n\n"
    "Each input returns the estimates of the sweeps that it completes: mostly none. Late, duplicate and non-finite\n"
    "input and foreign packets are counted and are no error. Raises locus.Error for an invalid configuration, a "
    "source\n"
    "that is not configured or of another kind, arrays of wrong shape and stamps outside 1951 to 2096.";
constexpr Text kPacket =
    "Processes the payload of a UDP datagram: bytes, or any object with a contiguous buffer of them.\n\n"
    "arrival_ns: time of its arrival. port: destination port. source_ip: address of the sender,\n"
    "text or a number in host byte order; 0: unknown.";
constexpr Text kCloud =
    "Processes a cloud of a lidar that has a topic in the configuration.\n\n"
    "xyz: (n, 3), metres, frame of the lidar; read as float32. stamp_ns: zero of `time`, by the clock of the\n"
    "lidar. arrival_ns: time of its arrival; None: stamp_ns. time: (n,), seconds since stamp_ns; None: unknown.\n"
    "ring: (n,), laser of each point, read as uint16. intensity: (n,), 0 to 255.";
constexpr Text kImu = "Processes a reading of a motion source of kind imu, in its own frame.\n\n"
                      "angular_velocity: (3,), rad/s. specific_force: (3,), m/s^2, +9.81 on z at rest and level. "
                      "orientation_xyzw: (4,),\n"
                      "in a level frame of any heading, or None. arrival_ns: time of its arrival; None: stamp_ns.";
constexpr Text kOdometrySample =
    "Processes a pose of a motion source of kind odometry.\n\n"
    "position: (3,), metres, and orientation_xyzw: (4,), of base in the frame of the source. covariance_scale:\n"
    "ratio of its covariance to the usual one. arrival_ns: time of its arrival; None: stamp_ns.";

void define_odometry(py::module_& module) {
  using py::arg;
  py::class_<Odometry> definition(module, "Odometry", py::is_final(), kOdometry);
  definition
      .def(py::init([](const File& config, const Settings& set) {
             return std::make_unique<Odometry>(config.value_or(""), set);
           }),
           arg("config") = py::none(), arg("set") = py::tuple())
      .def("packet", packet, kPacket, arg("payload"), arg("arrival_ns"), arg("port") = 2368, arg("source_ip") = 0)
      .def("cloud", cloud, kCloud, arg("lidar"), arg("xyz"), arg("stamp_ns"), arg("arrival_ns") = py::none(),
           arg("time") = py::none(), arg("ring") = py::none(), arg("intensity") = py::none())
      .def("imu", imu, kImu, arg("source"), arg("stamp_ns"), arg("angular_velocity"), arg("specific_force"),
           arg("orientation_xyzw") = py::none(), arg("arrival_ns") = py::none())
      .def("odometry", odometry, kOdometrySample, arg("source"), arg("stamp_ns"), arg("position"),
           arg("orientation_xyzw"), arg("covariance_scale") = 1.0, arg("arrival_ns") = py::none())
      .def(
          "finish", [](Odometry& shared) { return shared.compute([](auto& object) { return object.finish(); }); },
          "Ends the input; returns the last sweep if more than half of it was received. Later inputs are\n"
          "errors.");
  add_views(definition);
}

constexpr Text kReplay =
    "Odometry of a recording: whatever locus-replay reads. Returns an iterator of estimates, see Replay.\n\n"
    "config: None: that of the recording, or the defaults. set: changes to it, as --set of locus-replay. start: skips\n"
    "input that arrived earlier, seconds from the start of the recording. duration: length of the part, seconds;\n"
    "None: to its end. Raises locus.Error if the recording or the configuration cannot be read.";

void define_replay(py::module_& module) {
  using py::arg;
  py::class_<Replay> definition(
      module, "Replay", py::is_final(),
      "The estimates of a recording, sweep by sweep; made by replay().\n\nThe iteration raises "
      "locus.Error at the end of a recording without a packet or cloud that could be used.");
  definition.def("__iter__", [](py::object self) { return self; })
      .def("__next__", next)
      .def(
          "warnings", [](Replay& shared) { return shared.compute([](auto& object) { return object.warnings(); }); },
          "Warnings about the recording and its configuration, one per line; complete at its end.");
  add_views(definition);
  module.def("replay", replay, kReplay, arg("path"), arg("config") = py::none(), arg("set") = py::tuple(),
             arg("start") = py::none(), arg("duration") = py::none());
}

} // namespace
} // namespace locus_python

PYBIND11_MODULE(_native, module) {
  using namespace locus_python;
  module.doc() = "Native part of the package locus.";
  module.attr("__name__") = "locus"; // public name of the module
  py::register_exception<liblocus::Error>(module, "Error", PyExc_RuntimeError).attr("__doc__") =
      "Error: what is wrong, where, and what to do; one line per mistake, as by locus-replay.";
  define_source_estimate(module);
  define_estimate(module);
  define_odometry(module);
  define_replay(module);
}
