#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""page.py PERFORMANCE.JSON [--docs FOLDER]: writes docs/performance.md and its pictures anew from what measure.py kept.

In the page, figures stand between a line '<!-- figures: NAME -->' and the next '<!-- end -->'; what stands between is
replaced, the rest is written by people and stays."""

import argparse
import json
import re
import sys
from pathlib import Path

sys.dont_write_bytecode = True  # writes only the page beside the sources
import tables
from figures import Figures

DOCS = Path(__file__).resolve().parents[2] / "docs"
BLOCK = re.compile(r"(<!-- figures: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


def fill(template, figures):
    wanted = [name for _, name, _ in BLOCK.findall(template)]
    unknown, missing = set(wanted) - set(tables.BLOCKS), set(tables.BLOCKS) - set(wanted)
    if unknown or missing:
        raise SystemExit(f"performance.md: figures without a table: {sorted(unknown)}, "
                         f"tables without a place: {sorted(missing)}: see BLOCKS in tables.py")
    return BLOCK.sub(lambda block: block[1] + tables.BLOCKS[block[2]](figures) + "\n" + block[3], template)


def write(measured, docs):
    figures = Figures(measured)
    page = fill((DOCS / "performance.md").read_text(), figures)
    images = docs / "images"
    images.mkdir(parents=True, exist_ok=True)
    for name, draw in tables.PICTURES.items():
        (images / f"performance-{name}.svg").write_text(draw(figures))
    (docs / "performance.md").write_text(page)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("figures", metavar="PERFORMANCE.JSON", type=Path)
    parser.add_argument("--docs", type=Path, default=DOCS, help="where the page goes; default: docs/")
    arguments = parser.parse_args()
    write(json.loads(arguments.figures.read_text()), arguments.docs)


if __name__ == "__main__":
    main()
