#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# python_types.sh PYTHON TESTS EXAMPLES: the types of the package locus are those of what it has, and of what tests and
# examples do with it.
set -euo pipefail
export PYTHONPATH=$1 MYPYPATH=$1 PYTHONDONTWRITEBYTECODE=1
work=$(mktemp -d)
trap 'rm -r "$work"' EXIT
cd "$work" # where mypy keeps what it found
/usr/bin/python3 -m mypy.stubtest --allowlist "$2"/stubtest_allowed.txt locus
/usr/bin/python3 -m mypy --strict "$2"/python_test.py "$2"/python_speed.py
/usr/bin/python3 -m mypy --strict "$3"/replay.py
# Who mistakes a shape of a call is told.
printf 'import locus\nlocus.Odometry().packet("text", 0)\n' >wrong.py
! /usr/bin/python3 -m mypy --strict wrong.py >said || { echo "mypy takes text for bytes"; exit 1; }
grep -q 'arg-type' said
