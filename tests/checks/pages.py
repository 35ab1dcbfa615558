#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""pages.py BIN: checks that the links, anchors and options in the Markdown pages exist.

Each relative link must lead to a file, and its anchor to a heading. The pages of a package may link only to files of
that package. Each option in a command of a locus program must be in the help of that program, and each option alone in
code in that of any of them, as far as BIN has them. Decisions describe the options of their time.
"""
import functools
import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BIN = Path(sys.argv[1])
FENCE = re.compile(r"^ *```.*?^ *```", re.DOTALL | re.MULTILINE)
SPAN = re.compile(r"(`+)(?!`)(.+?)(?<!`)\1(?!`)", re.DOTALL)
LINK = re.compile(r"\]\(([^)\s]+)\)")
PROGRAMS = ["locusd", "locusctl", *(f"locus-{name}" for name in ("demo", "experiments", "play", "replay", "sim"))]
OPTION = re.compile(r"--[a-z][\w-]*")
OTHERS = {"--cpu-rt-runtime", "--memory", "--restart", "--ulimit", "--gtest_filter"}  # of docker and GoogleTest


def anchors(page):
    """Returns the anchors of the headings, as GitHub makes them."""
    seen, found = {}, set()
    for heading in re.findall(r"^#+ +(.+?) *$", FENCE.sub("", page.read_text()), re.MULTILINE):
        text = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading).lower()
        anchor = re.sub(r"[^\w\- ]", "", text).replace(" ", "-")
        seen[anchor] = seen.get(anchor, -1) + 1
        found.add(f"{anchor}-{seen[anchor]}" if seen[anchor] else anchor)
    return found


def links(page):
    """Returns (target, anchor) of each relative link; None without an anchor."""
    text = SPAN.sub("", FENCE.sub("", page.read_text()))
    for link in LINK.findall(text):
        if "://" not in link and not link.startswith("mailto:"):
            path, _, anchor = link.partition("#")
            yield (page.parent / path).resolve() if path else page, anchor or None


def wrong_links(page):
    for target, anchor in links(page):
        if not target.exists():
            yield f"links to {os.path.relpath(target, ROOT)}, which does not exist"
        elif anchor and target.suffix == ".md" and anchor not in anchors(target):
            yield f"links to #{anchor} of {target.relative_to(ROOT)}, which has no such heading"


def shipped(package):
    """Returns the files that packaging/debian/PACKAGE.docs installs."""
    for pattern in (ROOT / f"packaging/debian/{package}.docs").read_text().split():
        for file in ROOT.glob(pattern):
            yield from file.rglob("*") if file.is_dir() else [file]


def missing_in_packages():
    for docs in sorted((ROOT / "packaging/debian").glob("*.docs")):
        files = set(shipped(docs.stem))
        for page in sorted(files):
            if page.suffix == ".md":
                for target, _ in links(page):
                    if target.exists() and target not in files:
                        yield (f"{page.relative_to(ROOT)}: links to {target.relative_to(ROOT)}, which the package "
                               f"{docs.stem} does not ship; add it to {docs.relative_to(ROOT)}")


@functools.cache
def options(program):
    """Returns the options in the help of a program and of its commands; None if it is not built."""
    file = BIN / program
    if not file.exists():
        return None

    def text(*command):
        return subprocess.run([file, *command, "--help"], capture_output=True, text=True, check=True).stdout
    help_text = text()
    commands = re.search(r"^(?:Sub)?commands:\n((?:  .*\n)+)", help_text, re.MULTILINE | re.IGNORECASE)
    names = re.findall(r"^  ([a-z-]+) ", commands[1], re.MULTILINE) if commands else []
    return set(OPTION.findall(help_text + "".join(text(name) for name in names)))


def named_program(words):
    """Returns the locus program that a command runs, behind sudo and variables; None if it runs another."""
    for word in words:
        if os.path.basename(word) in PROGRAMS:
            return os.path.basename(word)
        if word != "sudo" and "=" not in word:
            return None
    return None


def wrong_options(page):
    text = page.read_text()
    spans = [" ".join(span.split()) for _, span in SPAN.findall(FENCE.sub("", text))]
    lines = [line for block in FENCE.findall(text) for line in re.sub(r"\\\n", " ", block).splitlines()]
    for command in [part for line in lines + spans for part in re.split(r"[|;&()#]", line)]:
        if program := named_program(command.split()):
            known = options(program)
            if known is not None:
                for option in set(OPTION.findall(command)) - known:
                    yield f"{program} has no option {option}: {command.strip()}"
    helps = [options(program) for program in PROGRAMS]
    if None not in helps:
        for option in {OPTION.match(span)[0] for span in spans if OPTION.match(span)} - set().union(*helps) - OTHERS:
            yield f"no program has the option {option}"


def main():
    today = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "tests").rglob("*.md"))]
    decisions = sorted((ROOT / "docs/decisions").glob("*.md"))
    problems = [f"{page.relative_to(ROOT)}: {problem}" for page in today + decisions for problem in wrong_links(page)]
    problems += [f"{page.relative_to(ROOT)}: {problem}" for page in today for problem in wrong_options(page)]
    problems += missing_in_packages()
    print(*problems, sep="\n")
    sys.exit(1 if problems else 0)


main()
