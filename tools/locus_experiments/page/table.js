// SPDX-License-Identifier: Apache-2.0
import {select} from "d3-selection";

import {figure, fixed} from "../../locus_replay/report/format.js";

/** Builds a table of `groups`, each {name, rows}; a row is an array of cells, the first of which is a heading. A cell may
 *  be {text, className}. */
export function table(parent, head, groups) {
  const element = parent.append("div").attr("class", "scroll").append("table");
  element.append("thead").append("tr").selectAll("th").data(head).join("th").attr("scope", "col").text((cell) => cell);
  for (const {name, rows} of groups) {
    const body = element.append("tbody");
    if (name)
      body.append("tr").append("th").attr("class", "group").attr("scope", "rowgroup").attr("colspan", head.length)
          .text(name);
    body.selectAll(null).data(rows).enter().append("tr").attr("class", (row) => row.className ?? null)
        .each(function (row) { cells(select(this), row); });
  }
}

function cells(tr, row) {
  tr.selectAll(null).data(row.cells).enter()
      .append((_, i) => document.createElement(i === 0 ? "th" : "td")).attr("scope", (_, i) => (i === 0 ? "row" : null))
      .attr("class", (cell) => cell?.className ?? null).text((cell) => cell?.text ?? cell);
}

export const missing = {text: "not run", className: "note"};

/** Formats an error in metres, to a tenth of a millimetre if it is small. */
export const metres = (value) => (Math.abs(value) < 0.1 ? fixed(value, 4) : figure(value));
