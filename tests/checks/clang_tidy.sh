#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# clang_tidy.sh BUILD_FOLDER: no finding of clang-tidy in any unit that the build compiles, on all
# processors.
build=$(realpath "$1")
source "$(dirname "$0")/sources.sh"
room="($(IFS='|'; echo "${rooms[*]}"))"
run-clang-tidy -quiet -j "$(nproc)" -p "$build" -checks=-bugprone-suspicious-include \
  "^($PWD|$build)/$room/.*\.(cpp|cxx)$" 2>&1 | sed -E '/^clang-tidy/d; /warnings? generated\.$/d'
