#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Every source is as clang-format leaves it.
source "$(dirname "$0")/sources.sh"
cpp_sources | xargs clang-format --dry-run -Werror
