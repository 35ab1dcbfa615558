// SPDX-License-Identifier: Apache-2.0
// Fig. 6, Table V, the load of Table II (time, dropped sweeps and cores at the pace of the recording), and Table III.
import {figure as written} from "../../locus_replay/report/format.js";
import {paced, robustness as paperRobustness} from "./paper.js";
import {courseName, courses, find, results} from "./results.js";
import {metres, missing, table} from "./table.js";

const kPaced = [{key: "pace_1cpu", name: "on one core"}, {key: "pace_2cpu", name: "on two cores"}];

function pacedRow(course, {key, name}) {
  const run = find(course, key);
  if (!run) return {cells: [name, missing, "", "", "", "", ""]};
  const {process_ms: took, sweeps, duration_s, cpu_s} = run.summary;
  return {className: "ours", cells: [name, written(took.p50), written(took.p90), written(took.p99), written(took.max),
      written(sweeps.dropped / duration_s), written(cpu_s / duration_s)]};
}

export function pace(section) {
  const groups = courses.map((course) => {
    const rows = kPaced.map((cpus) => pacedRow(course, cpus));
    const paper = results.simulated && paced[course];
    if (paper)
      rows.unshift({cells: ["paper: LOCUS", "–", "–", "–", "–", written(paper.dropped),
                            paper.cores ? written(paper.cores) : "–"]});
    return {name: courseName(course), rows};
  });
  table(section.select(".drawing").html(""),
        ["", "median ms per sweep", "90 %", "99 %", "max", "dropped sweeps per second", "cores used"], groups);
}

const kFailures = {wio_imu_fail: "WIO and IMU fail", wio_fail: "WIO fails", lidar_drop: "no lidar for 10 s"};

export function robustness(section) {
  const cell = (row, key) => {
    if (!row[key]) return missing;
    const text = `${row[key]}, ${metres(find(row.course, key).summary.ape_m.max)} m`;
    return {text, className: row[key] === "OK" ? null : "warning"};
  };
  const ours = results.robustness.map((row) => ({className: "ours", cells: [`locusd, ${courseName(row.course)}`,
      `${metres(find(row.course, "locusd").summary.ape_m.max)} m`,
      ...Object.keys(kFailures).map((key) => cell(row, key))]}));
  const theirs = {cells: ["paper: LOCUS", "–", ...Object.keys(kFailures).map((key) => paperRobustness[key])]};
  table(section.select(".drawing").html(""), ["", "no failure", ...Object.values(kFailures)],
        [{rows: [theirs, ...ours]}]);
}
