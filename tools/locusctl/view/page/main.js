// SPDX-License-Identifier: Apache-2.0
// The page of locusctl view. One request at a time and one per drawn frame, so that a slow browser or tunnel only shows
// fewer sweeps, and a hidden page costs nothing. The page sets data-sequence to the sweep that it has drawn.
import {select} from "d3-selection";

import {Live} from "./live.js";
import {liveMap} from "./live_map.js";
import {bounds, ellipse, heading, lidars, sources} from "./panels.js";

const kPeriod_ms = 100, kPatience_ms = 10000, kTablePeriod_ms = 500;
const kPanels = {
  ellipse,
  sources,
  lidars
};

const live = new Live();
let map, tables_drawn_at = 0;

function draw(changed) {
  if (map === undefined) map = liveMap(select("#map"), live);
  map?.update(changed);
  heading(live);
  bounds(live);
  if (performance.now() - tables_drawn_at > kTablePeriod_ms) drawPanels();
  if (live.pose) document.body.dataset.sequence = live.pose.sequence;
}

function drawPanels() {
  tables_drawn_at = performance.now();
  for (const [id, drawPanel] of Object.entries(kPanels)) drawPanel(select(`#${id}`), live);
}

async function request() {
  const response = await fetch(live.query(), {signal: AbortSignal.timeout(kPatience_ms)});
  if (!response.ok) throw new Error(`HTTP status ${response.status}`);
  return response.arrayBuffer();
}

async function poll() {
  let delay_ms = kPeriod_ms;
  try {
    const changed = live.add(await request());
    draw(changed);
    if (changed.more) delay_ms = 0;
  } catch (error) {
    live.problem = `locusctl view does not answer (${error.message}): start it again`;
    heading(live);
    delay_ms = 10 * kPeriod_ms;
  }
  setTimeout(() => requestAnimationFrame(poll), delay_ms);
}

function adapt() {
  map?.refresh();
  drawPanels();
}

poll();
window.addEventListener("resize", adapt);
window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", adapt);
