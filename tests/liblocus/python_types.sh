#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# python_types.sh PYTHON TESTS EXAMPLES: the type stubs of the package locus agree with its content and with its use in
# tests and examples.
set -euo pipefail
export PYTHONPATH=$1 MYPYPATH=$1 PYTHONDONTWRITEBYTECODE=1
work=$(mktemp -d)
trap 'rm -r "$work"' EXIT
cd "$work" # mypy's cache goes here
/usr/bin/python3 -m mypy.stubtest --allowlist "$2"/stubtest_allowed.txt locus
/usr/bin/python3 -m mypy --strict "$2"/python_test.py "$2"/python_speed.py
/usr/bin/python3 -m mypy --strict "$3"/replay.py
# Calls with wrong types are reported.
printf 'import locus\nlocus.Odometry().packet("text", 0)\n' >wrong.py
! /usr/bin/python3 -m mypy --strict wrong.py >said || { echo "mypy takes text for bytes"; exit 1; }
grep -q 'arg-type' said
