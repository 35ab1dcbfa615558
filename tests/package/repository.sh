#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# repository.sh SOURCE FOLDER: a robot installs locusd by apt from a repository with the packages of FOLDER, and
# upgrades by unattended-upgrades as documented; packages with another signature or modified content are rejected.
set -euo pipefail
here=$(dirname "$(realpath "$0")")
source=$(realpath "$1") folder=$(realpath "$2")
source "$here/base_tree.sh"
source "$source/packaging/releases.sh"
probe
for program in reprepro gpg; do
  command -v $program >/dev/null || skip "there is no $program; packaging/install-build-deps.sh installs it"
done
suite=$(suite_of "$folder")
base=$(base_tree "$folder" unattended-upgrades)

work=$(mktemp -d -t locusd-repository.XXXXXX)
export GNUPGHOME=$work/gnupg
clean_up() {
  gpgconf --kill all || true
  umount "$work/root" 2>/dev/null || true
  rm -rf "$work"
}
trap clean_up EXIT
mkdir -m 700 "$GNUPGHOME"
mkdir "$work"/{root,upper,overlay}
mount -t overlay overlay -o "lowerdir=$base,upperdir=$work/upper,workdir=$work/overlay" "$work/root"

step() { echo "-- $*"; }
publish() { "$source/packaging/apt-repository.sh" "$@"; }
on_robot() {
  systemd-nspawn --quiet --directory="$work/root" --register=no --keep-unit --private-network --console=pipe \
    --bind-ro="$work/repository/public:/srv/locusd" --setenv=DEBIAN_FRONTEND=noninteractive "$@" </dev/null
}
refused() { # WHY COMMAND...
  local why=$1
  shift
  if "$@" >"$work/said" 2>&1; then cat "$work/said"; echo "was not rejected: $*"; exit 1; fi
  grep -E "$why" "$work/said" || { cat "$work/said"; echo "rejected, but not for: $why"; exit 1; }
}
is_version() { [ "$(on_robot dpkg-query -W -f '${Version}' locusd)" = "$1" ]; }
newer() { # VERSION: prints the path of a package of it, with another configuration
  dpkg-deb -R "$folder"/locusd_*.deb "$work/$1"
  echo "# of $1" >>"$work/$1/etc/locusd/locusd.yaml"
  sed -i "s/^Version: .*/Version: $1/" "$work/$1/DEBIAN/control"
  dpkg-deb -b "$work/$1" "$work" >/dev/null
  echo "$work/locusd_$1_$(dpkg --print-architecture).deb"
}

step "a robot installs it from there"
publish "$work/repository" "$folder"/*.deb
mkdir -p "$work/root/etc/apt/keyrings"
cp "$work/repository/public/locusd.asc" "$work/root/etc/apt/keyrings"
rm -f "$work"/root/etc/apt/sources.list{,.d/*}
cat >"$work/root/etc/apt/sources.list.d/locusd.sources" <<SOURCES
Types: deb
URIs: file:/srv/locusd
Suites: $suite
Components: main
Signed-By: /etc/apt/keyrings/locusd.asc
SOURCES
on_robot apt-get --quiet update
on_robot apt-get --quiet --yes install --no-install-recommends locusd
is_version "$(dpkg-deb -f "$folder"/locusd_*.deb Version)"

step "unattended-upgrades installs a newer version and keeps edited files"
echo "# edited" >>"$work/root/etc/locusd/locusd.yaml"
cp "$source/docs/examples/52unattended-upgrades-locusd" "$work/root/etc/apt/apt.conf.d"
newest=98$(suffix_of "$suite")
publish "$work/repository" "$(newer "$newest")"
on_robot apt-get --quiet update
on_robot unattended-upgrade --verbose
is_version "$newest"
[ "$(tail -n 1 "$work/root/etc/locusd/locusd.yaml")" = "# edited" ]

step "a modified package is rejected"
publish "$work/repository" "$(newer "99$(suffix_of "$suite")")"
find "$work/repository/public" -name 'locusd_99*.deb' -exec sh -c 'printf x | dd of="$1" bs=1 seek=5000 conv=notrunc status=none' sh {} \;
on_robot apt-get --quiet update
refused "Hash Sum mismatch" on_robot apt-get --quiet --yes upgrade
is_version "$newest"

step "a modified list is rejected"
sed -i "s/^Date: .*/Date: $(date --utc --rfc-email --date='+1 hour' | sed 's/+0000/UTC/')/" "$work/repository/public/dists/$suite"/InRelease
refused "BADSIG|signatures were invalid|verification failed|[Bb]ad signature" on_robot apt-get --quiet --error-on=any update

step "a list signed by someone else is rejected"
rm -rf "$work/repository"
gpg --batch --quiet --passphrase '' --quick-generate-key somebody ed25519 sign never
publish --key somebody "$work/repository" "$(newer "100$(suffix_of "$suite")")"
refused "NO_PUBKEY|not available|[Mm]issing key" on_robot apt-get --quiet --error-on=any update
is_version "$newest"

step "a key that this account lacks is rejected, and the repository is unchanged"
cp "$work/repository/conf/distributions" "$work/before"
refused "nobody: no secret key" publish --key nobody "$work/repository" "$(newer "101$(suffix_of "$suite")")"
cmp "$work/repository/conf/distributions" "$work/before"

step "a package for no release is rejected before anything changes"
refused "for no release" publish "$work/nothing" "$(newer 7)"
[ ! -e "$work/nothing" ]
