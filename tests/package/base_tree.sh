# SPDX-License-Identifier: Apache-2.0
# To be sourced. Says why a Debian system cannot be booted here, or makes one to boot.

# skip WHY: ctest shows the test as skipped.
skip() {
  echo "SKIPPED: $*"
  exit 77
}

# Whether all that the tests need can be had; what a machine may forbid is tried, not guessed.
probe() {
  [ "$(id -u)" -eq 0 ] || skip "only root can boot a Debian system in a container"
  for program in systemd-nspawn mmdebstrap ip; do
    command -v $program >/dev/null || skip "there is no $program; packaging/install-build-deps.sh installs it"
  done
  local tried
  tried=$(mktemp -d)
  mkdir "$tried"/{lower,upper,work,merged}
  mount -t overlay overlay -o "lowerdir=$tried/lower,upperdir=$tried/upper,workdir=$tried/work" "$tried/merged" ||
    skip "overlay file systems cannot be mounted"
  umount "$tried/merged"
  rm -r "$tried"
  unshare --net ip link add locus-probe type veth || skip "there are no network namespaces with veth"
}

# base_tree FOLDER: the path of a bootable Debian with what the packages in FOLDER depend on, and ss for the test. Made
# once for each such list of packages.
base_tree() {
  local cache=${XDG_CACHE_HOME:-/var/cache}/locusd-tests packages tree
  packages=$(for deb in "$1"/locus{d,-tools}_*.deb; do
    dpkg-deb -f "$deb" Pre-Depends Depends | sed 's/^[^:]*: //; s/ *([^)]*)//g; s/ *|[^,]*//g'
    echo
  done | tr ', ' '\n\n' | sort -u | xargs)
  tree=$cache/bookworm-$(sha256sum <<<"$packages" | head -c 12)
  if [ ! -d "$tree" ]; then
    mkdir -p "$cache"
    mmdebstrap --quiet --variant=minbase --include="systemd-sysv dbus iproute2 $packages" bookworm "$tree.$$" >&2 ||
      { rm -rf "$tree.$$"; skip "mmdebstrap could not make a Debian system; is there a network?"; }
    mv "$tree.$$" "$tree"
  fi
  echo "$tree"
}
