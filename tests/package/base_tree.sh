# SPDX-License-Identifier: Apache-2.0
# To be sourced. Creates a bootable Debian system, or explains why that is impossible here.

# skip WHY: ctest reports the test as skipped.
skip() {
  echo "SKIPPED: $*" >&2
  exit 77
}

# Checks the prerequisites of the tests by trying them, because a machine may forbid some.
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

# suite_of FOLDER: prints the Debian release of the packages there.
suite_of() { sed -n 's/^Distribution: //p' "$1"/*.changes; }

# depends_of DEB...: prints the dependencies of these packages, one per line, except the packages themselves.
depends_of() {
  for deb in "$@"; do
    dpkg-deb -f "$deb" Pre-Depends Depends | sed 's/^[^:]*: //; s/ *([^)]*)//g; s/:any//g; s/ *|[^,]*//g'
  done | tr ', ' '\n\n' | grep -vxE 'liblocus0|liblocus-dev|python3-locus|' | sort -u
}
# library_depends FOLDER: prints the dependencies of the library and Python packages there.
library_depends() { depends_of "$1"/{liblocus0,liblocus-dev,python3-locus}_*.deb; }

# base_tree FOLDER [PACKAGE...]: prints the path of a bootable Debian of the packages' release, with the dependencies of
# the packages in FOLDER, ss for the test, and PACKAGE. Created once per list of packages.
base_tree() {
  local cache=${XDG_CACHE_HOME:-/var/cache}/locusd-tests suite packages tree
  suite=$(suite_of "$1")
  packages=$({ depends_of "$1"/locus{d,-tools}_*.deb; printf '%s\n' "${@:2}"; } | sort -u | xargs)
  tree=$cache/$suite-$(sha256sum <<<"$packages" | head -c 12)
  if [ ! -d "$tree" ]; then
    mkdir -p "$cache"
    mmdebstrap --quiet --variant=minbase --include="systemd-sysv dbus iproute2 $packages" "$suite" "$tree.$$" >&2 ||
      { rm -rf "$tree.$$"; skip "mmdebstrap could not make a Debian $suite; is there a network?"; }
    mv -T "$tree.$$" "$tree"
  fi
  echo "$tree"
}
