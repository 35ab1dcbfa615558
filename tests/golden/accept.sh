#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# accept.sh [FILTER]: takes the estimates of the present code for right, those of all drives or of those whose tests the
# filter of GoogleTest names ('*urban*'). Says of each what has changed; git diff shows the rest.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
[ -d build/dev ] || cmake --preset dev --log-level=WARNING
cmake --build --preset dev --target golden_tests
LOCUS_ACCEPT_TRACES=1 build/dev/bin/golden_tests --gtest_brief=1 --gtest_filter="${1:-*}"
