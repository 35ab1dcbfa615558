#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# piuparts.sh FOLDER: installing, removing and purging the packages of FOLDER leaves the system unchanged.
set -euo pipefail
source "$(dirname "$(realpath "$0")")/base_tree.sh"
probe
command -v piuparts >/dev/null || skip "there is no piuparts; packaging/install-build-deps.sh installs it"
base=$(base_tree "$1" $(library_depends "$1"))
# The ignored folder is debconf's own, which piuparts of Debian 12 does not know for Debian 13.
piuparts --existing-chroot "$base" --distribution "$(suite_of "$1")" --no-upgrade-test --ignore /var/cache/debconf/tmp.ci/ \
  "$1"/locusd_*.deb "$1"/locus-tools_*.deb "$1"/locus-demo-data_*.deb "$1"/{liblocus0,liblocus-dev,python3-locus}_*.deb
