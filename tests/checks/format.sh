#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Every source is formatted by clang-format.
source "$(dirname "$0")/sources.sh"
cpp_sources | xargs clang-format --dry-run -Werror
