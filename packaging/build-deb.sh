#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# build-deb.sh [--suite SUITE] [--arch ARCH] [FOLDER]: builds the packages of packaging/debian/control from the tracked
# files of the work tree and puts them into FOLDER (build/deb). Installs missing build dependencies, as root or with sudo.
# For another Debian release (bookworm, trixie) or another ARCH (amd64, arm64) than this machine's it builds in a separate
# root tree, as root. Runs no tests.
set -euo pipefail
source=$(realpath "$(dirname "$0")/..")
source "$source/packaging/releases.sh"
work=$(mktemp -d -t locusd-deb.XXXXXX)
trap 'rm -rf "$work"' EXIT

fail() { echo "build-deb.sh: $1" >&2; exit 2; }
here_suite=$(. /etc/os-release && echo "${VERSION_CODENAME:-}") here_arch=$(dpkg --print-architecture)
suite=$here_suite arch=$here_arch
while [[ ${1:-} == --* ]]; do
  [ -n "${2:-}" ] || fail "$1: of what? E.g. --suite trixie --arch arm64"
  case $1 in
    --suite) suite=$2 ;;
    --arch) arch=$2 ;;
    *) fail "$1: no such option; there are --suite and --arch" ;;
  esac
  shift 2
done
[[ $arch =~ ^(amd64|arm64)$ ]] || fail "packages are for amd64 and arm64, not for '$arch'"
[ -n "${release_of[${suite:-none}]:-}" ] ||
  fail "packages are for Debian ${!release_of[*]}, not for '$suite'; name one by --suite, or look at packaging/Containerfile"

profiles=nocheck builds=binary
in_tree=()
# locus-demo-data is for all processors, so that only one build may make it.
[ "$arch" = "$here_arch" ] || profiles="cross nocheck" builds=any
[ "$suite $arch" = "$here_suite $here_arch" ] || in_tree=("$source/packaging/build-tree.sh" "$suite" "$arch" "$work")
folder=deb
[ ${#in_tree[@]} -eq 0 ] || folder=deb-$suite-$arch
result=$(realpath -m "${1:-$source/build/$folder}")

tree=$work/locusd
mkdir -p "$tree" "$result"
git -C "$source" ls-files -z | tar --create --directory="$source" --null --files-from=- | tar --extract --directory="$tree"

# debhelper sets a temporary home without the compiler cache, and the tree has another path each time.
if command -v ccache >/dev/null; then
  CCACHE_DIR=${CCACHE_DIR:-$(ccache --get-config cache_dir)}
  export CCACHE_DIR CCACHE_BASEDIR=$tree
fi

# Shows the compilation steps on a terminal; the full output goes to build.log.
log=$result/build.log
progress() { if [ -t 1 ]; then grep --line-buffered -oP '^\[\d+/\d+\]' | tr '\n' '\r'; else cat >/dev/null; fi; }

cd "$tree"
export LANG=C.UTF-8 # the same everywhere, since ccache hashes it
export DEB_BUILD_OPTIONS=${DEB_BUILD_OPTIONS-"parallel=$(nproc)"}" nocheck" DEB_BUILD_PROFILES=$profiles
"${in_tree[@]}" packaging/install-build-deps.sh "$arch"
mv packaging/debian debian
sed -i "1s/) [a-z]*;/$(suffix_of "$suite")) $suite;/" debian/changelog
if ! "${in_tree[@]}" dpkg-buildpackage --host-arch "$arch" --build=$builds --no-sign 2>&1 | tee "$log" | progress; then
  tail -n 40 "$log" >&2
  echo "build-deb.sh: dpkg-buildpackage failed; the end of $log stands above" >&2
  exit 1
fi
rm -f "$result"/{locusd,locus-tools,locus-demo-data,liblocus0,liblocus-dev,python3-locus}{,-dbgsym}_*.deb "$result"/locusd_*.{buildinfo,changes} # packages of other versions
mv "$work"/*.deb "$work"/*.buildinfo "$work"/*.changes "$result"
ls "$result"/*.deb
