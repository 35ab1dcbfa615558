#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds and tests everything: installs what is missing, runs the tests under the address and undefined-behaviour
# sanitizers, those of the live threads under the thread sanitizer, then all tests and checks as developers build. Ends
# with the summary of ctest, and with its exit status.
set -euo pipefail
cd "$(dirname "$0")"

packaging/install-build-deps.sh
for preset in asan tsan dev; do
  cmake --preset "$preset" --log-level=WARNING
  cmake --build --preset "$preset"
  ctest --preset "$preset" --parallel "$(nproc)"
done
