#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# build-deb.sh [FOLDER]: builds the packages locusd and locus-tools from the files that git tracks, as they are in the
# work tree, and lays them into FOLDER (build/deb). Installs what is missing to build, as root or with sudo; runs no tests.
set -euo pipefail
source=$(realpath "$(dirname "$0")/..")
result=$(realpath -m "${1:-$source/build/deb}")

"$source/packaging/install-build-deps.sh"

work=$(mktemp -d -t locusd-deb.XXXXXX)
trap 'rm -rf "$work"' EXIT
tree=$work/locusd
mkdir -p "$tree" "$result"
git -C "$source" ls-files -z | tar --create --directory="$source" --null --files-from=- | tar --extract --directory="$tree"
mv "$tree/packaging/debian" "$tree/debian"

# debhelper gives the build a home of its own, without the compiler's cache; the tree lies elsewhere each time.
if command -v ccache >/dev/null; then
  CCACHE_DIR=${CCACHE_DIR:-$(ccache --get-config cache_dir)}
  export CCACHE_DIR CCACHE_BASEDIR=$tree
fi

# The steps of the compilation on a terminal, all that is said in build.log.
log=$result/build.log
progress() { if [ -t 1 ]; then grep --line-buffered -oP '^\[\d+/\d+\]' | tr '\n' '\r'; else cat >/dev/null; fi; }

cd "$tree"
export DEB_BUILD_OPTIONS=${DEB_BUILD_OPTIONS-"parallel=$(nproc)"}" nocheck" DEB_BUILD_PROFILES=nocheck
if ! dpkg-buildpackage --build=binary --no-sign 2>&1 | tee "$log" | progress; then
  tail -n 40 "$log" >&2
  echo "build-deb.sh: dpkg-buildpackage failed; the end of $log stands above" >&2
  exit 1
fi
mv "$work"/*.deb "$work"/*.buildinfo "$work"/*.changes "$result"
ls "$result"/*.deb
