#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# clang_tidy.sh BUILD_FOLDER: no finding of clang-tidy in any unit that the build compiles.
build=$(realpath "$1")
source "$(dirname "$0")/sources.sh"
run-clang-tidy -quiet -j "$(nproc)" -p "$build" "^$PWD/($(IFS='|'; echo "${rooms[*]}"))/.*\.cpp$" 2>&1 |
  sed -E '/^clang-tidy/d; /warnings? generated\.$/d'
