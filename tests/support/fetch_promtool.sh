#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# fetch_promtool.sh FILE: extracts promtool from Debian's package prometheus, without installing its server. Fetched
# once; fails without a network.
set -euo pipefail
[ ! -x "$1" ] || exit 0
work=$(mktemp -d -t locusd-promtool.XXXXXX)
trap 'rm -rf "$work"' EXIT
chmod 755 "$work"
cd "$work"
apt_get() { timeout 20 apt-get --quiet -o Acquire::Retries=0 -o Acquire::http::Timeout=10 "$@"; }
apt_get download prometheus || { apt_get update && apt_get download prometheus; }
dpkg-deb --fsys-tarfile prometheus_*.deb | tar --extract ./usr/bin/promtool
mv usr/bin/promtool "$1.$$"
mv "$1.$$" "$1"
