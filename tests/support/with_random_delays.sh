#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# with_random_delays.sh CALLS [CTEST OPTIONS...]: runs the tests of threads and programs with a delay at about one in
# CALLS of the system calls at which a thread may lose its processor (random_delays.cpp). 1000 is a busy computer, 300 a
# bad one. As root: the library is preloaded into every program by a file of /etc, in a mount namespace of its own.
set -euo pipefail
build=$(realpath "$(dirname "$0")/../../build/dev")
calls=${1:?usage: with_random_delays.sh CALLS [CTEST OPTIONS...]}
preload=$(mktemp)
trap 'rm -f "$preload"' EXIT
echo "$build/tests/support/librandom_delays.so" >"$preload"
[ -e /etc/ld.so.preload ] || touch /etc/ld.so.preload # empty, it changes nothing
RANDOM_DELAYS=$calls unshare --mount bash -c '
  mount --bind "$1" /etc/ld.so.preload
  ctest --test-dir "$2" --label-regex threads --label-exclude "slow|package|timing" --output-on-failure "${@:3}"
' delays "$preload" "$build" "${@:2}"
