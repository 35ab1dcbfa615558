// SPDX-License-Identifier: Apache-2.0
// Results of LOCUS as reported by the paper: M. Palieri et al., "LOCUS: A Multi-Sensor Lidar-Centric Solution for
// High-Precision Odometry and 3D Mapping in Real-Time", IEEE Robotics and Automation Letters, 2020.

/** Table II: absolute position error (max, mean, std) and RMSE of the map error, all in metres. */
export const accuracy = {
  alpha: {
    name: "Alpha Course",
    rows: [{name: "LOCUS", ape: [1.69, 0.62, 0.57], map: 0.29},
           {name: "LOCUS_FGA", ape: [0.63, 0.26, 0.18], map: 0.28}],
  },
  beta: {
    name: "Beta Course",
    rows: [{name: "LOCUS", ape: [1.51, 0.88, 0.51], map: 0.69},
           {name: "LOCUS_FGA", ape: [1.20, 0.58, 0.39], map: 0.48}],
  },
  safety_research: {
    name: "Safety Research Course",
    rows: [{name: "LOCUS", ape: [3.39, 1.67, 0.76], map: 0.63},
           {name: "LIO-SAM, the best there", ape: [2.45, 1.26, 0.58], map: 0.52}],
  },
};

/** Table III. */
export const robustness = {wio_imu_fail: "OK", wio_fail: "OK", lidar_drop: "OK"};

/** Table V: dropped scans per second, mean of two runs on each course; and the mean number of processor cores used, from
 *  Table II, which lists it only for Beta. */
export const paced = {
  alpha: {dropped: 0},
  beta: {dropped: 0, cores: 2.72},
  spot_alpha: {dropped: (2.082 + 2.205) / 2},
  spot_beta: {dropped: (1.833 + 2.016) / 2},
};
