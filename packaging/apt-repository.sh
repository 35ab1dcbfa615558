#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# apt-repository.sh [--key KEY] FOLDER DEB...: creates or updates a signed repository in FOLDER with the packages DEB,
# built by packaging/build-deb.sh, for bookworm and trixie, amd64 and arm64. FOLDER/public can be served from a web server
# or a disk and contains the key locusd.asc. KEY is a secret key in this account's GnuPG; by default the first call creates
# one, which later calls reuse.
set -euo pipefail
packaging=$(dirname "$(realpath "$0")")
fail() { echo "apt-repository.sh: $1" >&2; exit "${2:-1}"; }

key=
if [ "${1:-}" = --key ]; then
  key=${2:-}
  [ -n "$key" ] || fail "--key: of which key? See gpg --list-secret-keys" 2
  shift 2
fi
[ $# -ge 2 ] || fail "usage: apt-repository.sh [--key KEY] FOLDER DEB..." 2
folder=$1
shift
for program in reprepro gpg; do
  command -v $program >/dev/null || fail "there is no $program; it is in Debian's package ${program/%gpg/gnupg}"
done
source "$packaging/releases.sh"

# Checks all packages before any change.
suites=()
for deb in "$@"; do
  version=$(dpkg-deb -f "$deb" Version) || fail "$deb: is no package"
  suite=$(suite_of_version "$version") || fail "$deb: its version $version is for no release that packaging/build-deb.sh knows"
  suites+=("$suite")
done

distributions=$folder/conf/distributions
if [ -z "$key" ] && [ -e "$distributions" ]; then
  key=$(sed -n '/^SignWith: /{s///p;q}' "$distributions")
fi
fingerprint() { # KEY: prints the fingerprint of the first matching secret key; empty if there is none
  { gpg --batch --with-colons --list-secret-keys "$1" 2>/dev/null || true; } | awk -F: '$1 == "fpr" && !n++ {print $10}'
}
if [ -z "$key" ]; then
  user="locusd packages of $(hostname)" key="=$user"
  [ -n "$(fingerprint "$key")" ] || gpg --batch --quiet --passphrase '' --quick-generate-key "$user" ed25519 sign never
fi
named=$key
key=$(fingerprint "$named")
[ -n "$key" ] || fail "$named: no secret key of this account; see gpg --list-secret-keys"

mkdir -p "$folder"/{conf,public}
for suite in "${!release_of[@]}"; do
  printf '%s\n' "Origin: locusd" "Label: locusd" "Codename: $suite" "Architectures: amd64 arm64" "Components: main" \
    "SignWith: $key" ""
done >"$distributions"
gpg --batch --yes --armor --export --output "$folder/public/locusd.asc" "$key"

for suite in "${suites[@]}"; do
  reprepro --silent --basedir "$folder" --outdir +b/public includedeb "$suite" "$1"
  shift
done
for suite in "${!release_of[@]}"; do
  reprepro --silent --basedir "$folder" --outdir +b/public export "$suite"
  reprepro --basedir "$folder" --outdir +b/public list "$suite"
done
