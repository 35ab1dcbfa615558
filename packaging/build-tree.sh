#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# build-tree.sh SUITE ARCH FOLDER COMMAND...: runs COMMAND in a separate Debian tree of the release SUITE, which builds for
# ARCH and runs programs of ARCH, by QEMU if necessary. FOLDER has the same path inside; the current folder must be in it.
# The tree is separate because the libraries of another release or ARCH would displace those of this system. It is created
# once and cached.
set -euo pipefail
suite=$1 arch=$2 folder=$(realpath "$3")
shift 3

fail() { echo "build-tree.sh: $1" >&2; exit 1; }
[ "$(id -u)" -eq 0 ] || fail "only root can run a Debian system in a container; run it with sudo"
for program in systemd-nspawn mmdebstrap; do
  command -v $program >/dev/null || fail "there is no $program; packaging/install-build-deps.sh installs it"
done

here=$(dpkg --print-architecture)
archs=$here compiler=build-essential
if [ "$arch" != "$here" ]; then
  archs+=,$arch compiler="crossbuild-essential-$arch qemu-user-static"
fi

cache=${XDG_CACHE_HOME:-/var/cache}/locusd-tests
tree=$cache/build-$suite-$arch
if [ ! -d "$tree" ]; then
  mkdir -p "$cache"
  mmdebstrap --quiet --variant=minbase --architectures="$archs" \
    --dpkgopt='path-exclude=/usr/share/doc/*' --dpkgopt=force-unsafe-io \
    --customize-hook='echo "APT::Keep-Downloaded-Packages \"false\";" >"$1/etc/apt/apt.conf.d/90-no-archives"' \
    --include="$compiler ccache" "$suite" "$tree.$$" >&2 ||
    { rm -rf "$tree.$$"; fail "mmdebstrap could not make a Debian $suite; is there a network?"; }
  mv "$tree.$$" "$tree"
fi

# Registers QEMU for programs of ARCH, inside only: since Linux 6.7 each user namespace has its own binfmt_misc list. An
# older kernel has one global list, which Debian's qemu-user-static fills.
inside='
mount -t binfmt_misc binfmt_misc /mnt 2>/dev/null && for each in /usr/lib/binfmt.d/qemu-*; do
  [ ! -e "$each" ] || cat "$each" >/mnt/register
done
exec "$@"'
binds=(--bind="$folder")
[ ! -d "${CCACHE_DIR:-}" ] || binds+=(--bind="$CCACHE_DIR")
exec systemd-nspawn --quiet --directory="$tree" --register=no --keep-unit --private-users=identity --capability=all \
  --console=pipe "${binds[@]}" --chdir="$PWD" --setenv=DEBIAN_FRONTEND=noninteractive \
  --setenv=DEB_BUILD_OPTIONS --setenv=DEB_BUILD_PROFILES --setenv=CCACHE_DIR --setenv=CCACHE_BASEDIR \
  bash -c "$inside" inside "$@" </dev/null
