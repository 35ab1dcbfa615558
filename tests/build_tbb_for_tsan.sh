#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds Debian's TBB with thread sanitizer instrumentation. With the packaged library it reports false races, and
# suppressing everything that touches TBB would hide real ones. Built once, in half a minute; prints its folder.
set -euo pipefail
version=$(dpkg-query -W -f '${source:Version}' libtbb-dev)
cache=${XDG_CACHE_HOME:-~/.cache}/locusd/tbb-tsan-${version}
if [[ ! -d $cache/lib ]]; then
  work=$(mktemp -d)
  trap 'rm -rf "$work"' EXIT
  mkdir "$work/lists" "$work/source"
  cat >"$work/debian.sources" <<SOURCES
Types: deb-src
URIs: http://deb.debian.org/debian
Suites: $(. /etc/os-release && echo "$VERSION_CODENAME")
Components: main
Signed-By: /usr/share/keyrings/debian-archive-keyring.gpg
SOURCES
  apt=(-o "Dir::Etc::SourceList=$work/debian.sources" -o "Dir::Etc::SourceParts=-" -o "Dir::State::Lists=$work/lists"
       -o "APT::Sandbox::User=root" -qq)
  {
    apt-get "${apt[@]}" update
    cd "$work/source"
    apt-get "${apt[@]}" --download-only source "onetbb=$version"
    dpkg-source --no-check -x ./*.dsc tree
    cmake -S tree -B build -G Ninja -DCMAKE_BUILD_TYPE=RelWithDebInfo -DCMAKE_CXX_COMPILER=clang++ \
      -DCMAKE_C_COMPILER=clang -DTBB_SANITIZE=thread -DTBB_TEST=OFF -DTBBMALLOC_BUILD=OFF -DTBB_STRICT=OFF \
      -DCMAKE_INSTALL_LIBDIR=lib -DCMAKE_INSTALL_PREFIX="$cache.new"
    cmake --build build
    cmake --install build
    mv "$cache.new" "$cache"
  } >&2
fi
echo "$cache"
