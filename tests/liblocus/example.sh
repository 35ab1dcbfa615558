#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# example.sh BUILD EXAMPLES RECORDING: builds the C++ example against the installed library with the flags of pkg-config
# only; its output must equal that of the Python example.
set -euo pipefail
build=$1 examples=$2 recording=$3
work=$(mktemp -d)
trap 'rm -r "$work"' EXIT
DESTDIR=$work cmake --install "$build" --component liblocus >/dev/null
folder=$(dirname "$(find "$work" -name liblocus.pc)")
export PKG_CONFIG_LIBDIR=$folder PKG_CONFIG_SYSROOT_DIR=$work
${CXX:-g++} -std=c++20 -Wall -Wextra -Wpedantic -Werror "$examples/replay.cpp" -o "$work/replay" \
  $(pkg-config --cflags --libs liblocus)
export LD_LIBRARY_PATH=${folder%/pkgconfig} PYTHONPATH=$build/python PYTHONDONTWRITEBYTECODE=1
"$work/replay" "$recording" >"$work/cpp" 2>"$work/cpp.said"
/usr/bin/python3 "$examples/replay.py" "$recording" >"$work/python" 2>"$work/python.said"
[ "$(wc -l <"$work/cpp")" -gt 50 ]
cmp "$work/cpp" "$work/python"
cmp "$work/cpp.said" "$work/python.said"
for example in "$work/replay" "/usr/bin/python3 $examples/replay.py"; do
  status=0
  $example "$work/nothing" 2>"$work/said" || status=$?
  [ $status -eq 1 ] && grep -q "$work/nothing" "$work/said" || { echo "$example: ended with $status"; cat "$work/said"; exit 1; }
done
