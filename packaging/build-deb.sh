#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# build-deb.sh [--arch ARCH] [FOLDER]: builds the packages locusd and locus-tools from the files that git tracks, as they
# are in the work tree, and lays them into FOLDER (build/deb). Installs what is missing to build, as root or with sudo; for
# another ARCH than this machine's (arm64) not here but in a tree of its own, as root. Runs no tests.
set -euo pipefail
source=$(realpath "$(dirname "$0")/..")
work=$(mktemp -d -t locusd-deb.XXXXXX)
trap 'rm -rf "$work"' EXIT

arch=$(dpkg --print-architecture)
profiles=nocheck
in_tree=()
if [ "${1:-}" = --arch ]; then
  [ -n "${2:-}" ] || { echo "build-deb.sh: --arch: of which processor? E.g. --arch arm64" >&2; exit 2; }
  if [ "$2" != "$arch" ]; then
    arch=$2
    profiles="cross nocheck"
    in_tree=("$source/packaging/cross-tree.sh" "$arch" "$work")
  fi
  shift 2
fi
result=$(realpath -m "${1:-$source/build/deb}")

tree=$work/locusd
mkdir -p "$tree" "$result"
git -C "$source" ls-files -z | tar --create --directory="$source" --null --files-from=- | tar --extract --directory="$tree"

# debhelper gives the build a home of its own, without the compiler's cache; the tree lies elsewhere each time.
if command -v ccache >/dev/null; then
  CCACHE_DIR=${CCACHE_DIR:-$(ccache --get-config cache_dir)}
  export CCACHE_DIR CCACHE_BASEDIR=$tree
fi

# The steps of the compilation on a terminal, all that is said in build.log.
log=$result/build.log
progress() { if [ -t 1 ]; then grep --line-buffered -oP '^\[\d+/\d+\]' | tr '\n' '\r'; else cat >/dev/null; fi; }

cd "$tree"
export DEB_BUILD_OPTIONS=${DEB_BUILD_OPTIONS-"parallel=$(nproc)"}" nocheck" DEB_BUILD_PROFILES=$profiles
"${in_tree[@]}" packaging/install-build-deps.sh "$arch"
mv packaging/debian debian
if ! "${in_tree[@]}" dpkg-buildpackage --host-arch "$arch" --build=binary --no-sign 2>&1 | tee "$log" | progress; then
  tail -n 40 "$log" >&2
  echo "build-deb.sh: dpkg-buildpackage failed; the end of $log stands above" >&2
  exit 1
fi
mv "$work"/*.deb "$work"/*.buildinfo "$work"/*.changes "$result"
ls "$result"/*_"$arch".deb
