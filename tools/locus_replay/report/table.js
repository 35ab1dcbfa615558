// SPDX-License-Identifier: Apache-2.0
// Building of tables.
import {select} from "d3-selection";

import {count} from "./format.js";

/** Builds a table. Each row is an array whose first cell is a heading. A cell may be {text, warning}. */
export function table(parent, head, rows) {
  const element = parent.append("div").attr("class", "scroll").append("table");
  element.append("thead").append("tr").selectAll("th").data(head).join("th").attr("scope", "col").text((cell) => cell);
  const row = element.append("tbody").selectAll("tr").data(rows).join("tr");
  row.each(function(cells) {
    select(this)
        .selectAll(null)
        .data(cells)
        .enter()
        .append((_, i) => document.createElement(i === 0 ? "th" : "td"))
        .attr("scope", (_, i) => (i === 0 ? "row" : null))
        .attr("class", (cell) => (cell?.warning ? "warning" : null))
        .text((cell) => cell?.text ?? cell);
  });
  return {head: element.select("thead tr"), rows: row};
}

/** Formats a count of anomalies: marked unless zero. */
export const mishap = (value) => (value > 0 ? {text: `▲ ${count(value)}`, warning: true} : count(value));
