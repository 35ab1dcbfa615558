// SPDX-License-Identifier: Apache-2.0
// Results shown by this page, as embedded by locus-experiments.

export const results = JSON.parse(document.getElementById("results").textContent);
export const runs = results.runs.filter((run) => !run.failed);
export const failures = results.runs.filter((run) => run.failed);

/** In run order. */
export const courses = [...new Set(results.runs.map((run) => run.course))];
export const find = (course, configuration) =>
    runs.find((run) => run.course === course && run.configuration === configuration);

const kCourseNames = {
  alpha: "Alpha", beta: "Beta", safety_research: "Safety Research",
  spot_alpha: "Alpha, Spot", spot_beta: "Beta, Spot",
};
export const courseName = (course) => (results.simulated && kCourseNames[course]) || course;

/** Descriptions of the configurations in the accuracy rows. */
export const configurations = {
  locusd: "locusd with default settings",
  locusd_fga: "locusd, flat ground detected by the IMU",
  paper: "locusd with the paper's settings",
  paper_fga: "the same, flat ground detected by the IMU",
};
