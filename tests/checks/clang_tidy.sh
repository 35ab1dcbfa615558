#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# clang_tidy.sh BUILD_FOLDER: clang-tidy reports nothing in any unit of the build; uses all processors. The checks are
# limited to the project's own code, see project_only.cpp.
build=$(realpath "$1")
source "$(dirname "$0")/sources.sh"
room="($(IFS='|'; echo "${rooms[*]}"))"
checks=-bugprone-suspicious-include,locus-project-only

folder=$build/clang_tidy
mkdir -p "$folder/core"
llvm=$(dirname "$(dirname "$(readlink -f "$(command -v clang-tidy)")")")
clang++ -std=c++17 -shared -fPIC -fno-rtti -isystem "$llvm/include" tests/checks/project_only.cpp -o "$folder/project_only.so"
printf '#!/bin/sh\nexec clang-tidy -load %q "$@"\n' "$folder/project_only.so" >"$folder/clang-tidy"
chmod +x "$folder/clang-tidy"

# Self-test: findings are reported, in headers as well.
echo 'struct A { virtual ~A() = default; virtual void f() {} }; struct B : A { void f() {} };' >"$folder/core/finding.hpp"
echo '#include "finding.hpp"' >"$folder/core/finding.cpp"
cp .clang-tidy "$folder"
if found=$("$folder/clang-tidy" -quiet -checks=$checks "$folder/core/finding.cpp" -- -std=c++20 2>&1) ||
  [[ $found != *modernize-use-override* ]]; then
  printf 'clang_tidy.sh: clang-tidy does not find what is wrong with %s\n%s\n' "$folder/core/finding.hpp" "$found" >&2
  exit 1
fi

run-clang-tidy -quiet -j "$(nproc)" -p "$build" -clang-tidy-binary "$folder/clang-tidy" -checks=$checks \
  "^($PWD|$build)/$room/.*\.(cpp|cxx)$" 2>&1 | sed -E '/clang-tidy -load/d; /^\/.*\/clang-tidy /d; /warnings? generated\.$/d'
