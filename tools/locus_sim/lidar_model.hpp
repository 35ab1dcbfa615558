// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <variant>

#include "drivers/hesai/model.hpp"
#include "drivers/velodyne/model.hpp"

namespace locus::sim {

/// Ouster models by their number of beams.
enum class OusterModel : std::uint8_t { os1_32 = 32, os1_128 = 128 };

/// Models that can be simulated; of Hesai's those whose packets all have one firing sequence.
using LidarModel = std::variant<velodyne::Model, hesai::Model, OusterModel>;

inline bool is_ouster(const LidarModel& model) { return std::holds_alternative<OusterModel>(model); }

/// Lidar model with its name on the command line.
struct NamedLidarModel {
  std::string_view name;
  LidarModel model;
  double max_range_m; ///< from the data sheet; at 10 % reflectivity half of it
};
inline constexpr std::array kLidarModels{
    NamedLidarModel{"VLP-16", velodyne::Model::vlp16, 100},   NamedLidarModel{"VLP-32C", velodyne::Model::vlp32c, 200},
    NamedLidarModel{"HDL-32E", velodyne::Model::hdl32e, 100}, NamedLidarModel{"OS1-32", OusterModel::os1_32, 170},
    NamedLidarModel{"OS1-128", OusterModel::os1_128, 170},    NamedLidarModel{"XT32", hesai::Model::xt32, 120}};

} // namespace locus::sim
