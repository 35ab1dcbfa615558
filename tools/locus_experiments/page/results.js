// SPDX-License-Identifier: Apache-2.0
// The results that this page shows, as locus-experiments wrote them into it.

export const results = JSON.parse(document.getElementById("results").textContent);
export const runs = results.runs.filter((run) => !run.failed);
export const failures = results.runs.filter((run) => run.failed);

/** In the order in which they were run. */
export const courses = [...new Set(results.runs.map((run) => run.course))];
export const find = (course, configuration) =>
    runs.find((run) => run.course === course && run.configuration === configuration);

const kCourseNames = {
  alpha: "Alpha", beta: "Beta", safety_research: "Safety Research",
  spot_alpha: "Alpha, Spot", spot_beta: "Beta, Spot",
};
export const courseName = (course) => (results.simulated && kCourseNames[course]) || course;

/** What the configurations of the accuracy rows are. */
export const configurations = {
  locusd: "locusd as it ships",
  locusd_fga: "locusd, flat ground when the IMU says so",
  paper: "locusd with the paper's settings",
  paper_fga: "the same, flat ground when the IMU says so",
};
