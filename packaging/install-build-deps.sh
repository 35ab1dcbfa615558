#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# install-build-deps.sh [ARCH]: installs the dependencies for building and testing locusd for ARCH: the Build-Depends of
# packaging/debian/control, except those excluded by DEB_BUILD_PROFILES. Returns at once if all are installed. Runs as
# root or with sudo, on Debian 12 or newer.
set -euo pipefail
host=(${1:+-a "$1"})
packaging=$(dirname "$(realpath "$0")")

fail() {
  echo "install-build-deps.sh: $1" >&2
  echo "  Install the Build-Depends of $packaging/debian/control by other means, then run again." >&2
  exit 1
}

if command -v dpkg-checkbuilddeps >/dev/null && dpkg-checkbuilddeps "${host[@]}" "$packaging/debian/control" 2>/dev/null; then
  exit 0
fi

command -v apt-get >/dev/null || fail "there is no apt-get; this is not Debian."
as_root=()
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo >/dev/null || fail "packages are missing, and without sudo only root can install them."
  as_root=(sudo)
fi

install() {
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive ${DEB_BUILD_PROFILES:+DEB_BUILD_PROFILES="$DEB_BUILD_PROFILES"} \
    apt-get build-dep "${host[@]}" --yes --no-install-recommends --option DPkg::Lock::Timeout=600 "$packaging"
}

# Fetches the package lists only if the installation fails, as on a machine with missing or outdated lists.
install || { "${as_root[@]}" apt-get update && install; } || fail "apt-get could not install all packages, see above."
