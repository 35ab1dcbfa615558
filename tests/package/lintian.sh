#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# lintian.sh FOLDER: lintian of the packages' Debian release reports nothing, not even remarks.
set -euo pipefail
here=$(dirname "$(realpath "$0")")
source "$here/base_tree.sh"
cd "$1"
suite=$(suite_of .)
in_tree=()
if [ "$suite" != "$(. /etc/os-release && echo "$VERSION_CODENAME")" ]; then
  in_tree=("$here/../../packaging/build-tree.sh" "$suite" "$(dpkg --print-architecture)" .)
  "${in_tree[@]}" bash -c "command -v lintian || apt-get install --yes --no-install-recommends lintian" >apt.log 2>&1 ||
    { tail apt.log; skip "lintian of $suite could not be installed; is there a network?"; }
fi
"${in_tree[@]}" lintian --allow-root -I --pedantic --fail-on error,warning,info,pedantic ./*.changes
