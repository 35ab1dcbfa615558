#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# accept.sh [FILTER]: accepts the estimates of the present code, of all drives or of those matched by a GoogleTest
# filter ('*urban*'). Prints what has changed in each; git diff shows the rest.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
[ -d build/dev ] || cmake --preset dev --log-level=WARNING
cmake --build --preset dev --target golden_tests
LOCUS_ACCEPT_TRACES=1 build/dev/bin/golden_tests --gtest_brief=1 --gtest_filter="${1:-*}"
