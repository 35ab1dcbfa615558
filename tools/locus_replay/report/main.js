// SPDX-License-Identifier: Apache-2.0
// The page of locus-replay's report. Figures fit the width of the page and are redrawn when that or its colours change;
// each sets data-drawn once drawn, and one that fails shows the reason without affecting the others.
import {select} from "d3-selection";

import {boxes} from "./boxes.js";
import {note, onNewWidth} from "./drawing.js";
import {heading} from "./heading.js";
import {mapView} from "./map_view.js";
import {plan, side} from "./projection.js";
import {run} from "./run.js";
import {configuration, input, sources, stages} from "./tables.js";
import {timeline} from "./timeline.js";

const kTables = {
  stages,
  input,
  sources,
  configuration
};
const kFigures = {
  plan,
  map: mapView,
  side,
  boxes,
  timeline
};

function draw(parts) {
  for (const [id, drawPart] of Object.entries(parts)) {
    const part = select(`#${id}`);
    try {
      drawPart(part, part.select(".drawing").node().clientWidth);
      part.attr("data-drawn", "yes");
    } catch (error) {
      note(part, `This part could not be drawn: ${error.message}`);
      console.error(error);
    }
  }
}

function drawFigures() {
  if (run.path)
    draw(kFigures);
  else
    for (const id of Object.keys(kFigures)) note(select(`#${id}`), "There was no sweep, so there is nothing to draw.");
}

heading();
draw(kTables);
drawFigures();
onNewWidth(drawFigures);
window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawFigures);
