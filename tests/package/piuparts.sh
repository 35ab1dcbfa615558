#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# piuparts.sh FOLDER: installing, removing and purging the packages of FOLDER leaves a system as it was.
set -euo pipefail
source "$(dirname "$(realpath "$0")")/base_tree.sh"
probe
command -v piuparts >/dev/null || skip "there is no piuparts; packaging/install-build-deps.sh installs it"
base=$(base_tree "$1")
piuparts --existing-chroot "$base" --distribution bookworm --no-upgrade-test \
  "$1"/locusd_*.deb "$1"/locus-tools_*.deb
