// SPDX-License-Identifier: Apache-2.0
// The page of locus-experiments. Each part sets data-drawn once drawn; one without data is left out, and one that fails
// shows the reason without affecting the others.
import {select} from "d3-selection";

import {note, onNewWidth} from "../../locus_replay/report/drawing.js";
import {duration} from "../../locus_replay/report/format.js";
import {ablation, ablationTable} from "./ablation.js";
import {accuracyTable, boxes} from "./accuracy.js";
import {pace, robustness} from "./pace.js";
import {courseName, failures, find, results, runs} from "./results.js";

const has = (configuration) => runs.some((run) => run.configuration.startsWith(configuration));
const compared = runs.some((run) => run.position_error);
const ablated = ["imu_int", "no_int", "rdf_off", "vgf_off", "mdc_off"].some((key) => find("alpha", key));
const kParts = [
  {id: "accuracy", draw: accuracyTable, wanted: compared},
  {id: "boxes", draw: boxes, wanted: compared},
  {id: "robustness", draw: robustness, wanted: results.robustness.length > 0},
  {id: "ablation", draw: ablation, wanted: ablated},
  {id: "ablation-table", draw: ablationTable, wanted: ablated},
  {id: "pace", draw: pace, wanted: has("pace_")},
];

function heading() {
  const machines = [...new Set(runs.map((run) => run.machine))];
  select("#about").text(`locus-experiments ${results.version}, ${runs.length} runs on ${machines.join("; ")}`);
  select("#simulated").attr("hidden", results.simulated ? null : "");
  select("#recorded").attr("hidden", results.simulated ? "" : null);
  if (results.simulated) {
    const {value, unit} = duration(results.duration_s);
    select("#duration").text(`${value} ${unit}`);
  }
  select("#failures").selectAll("li").data(failures).join("li")
      .text((run) => `${courseName(run.course)}, ${run.configuration}: ${run.failed}`);
  select("#failed").attr("hidden", failures.length > 0 ? null : "");
}

function draw() {
  for (const {id, draw: drawPart, wanted} of kParts) {
    const part = select(`#${id}`).attr("hidden", wanted ? null : "");
    if (!wanted) continue;
    try {
      drawPart(part, part.select(".drawing").node().clientWidth);
      part.attr("data-drawn", "yes");
    } catch (error) {
      note(part, `This part could not be drawn: ${error.message}`);
      console.error(error);
    }
  }
}

heading();
draw();
onNewWidth(draw);
