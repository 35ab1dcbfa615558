#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# contents.sh SOURCE FOLDER: the packages have the version of the sources and of their Debian release, few dependencies,
# and no trace of their build folder.
set -euo pipefail
source=$1 folder=$2
status=0
complain() { echo "$*"; status=1; }
source "$source/packaging/releases.sh"
source "$source/tests/package/base_tree.sh"
version=$(grep -oP '^project\(locusd VERSION \K[0-9.]+' "$source/CMakeLists.txt")$(suffix_of "$(suite_of "$folder")")
for package in locusd locus-tools liblocus0 liblocus-dev python3-locus; do
  deb=$(echo "$folder/${package}"_*.deb)
  [ "$(dpkg-deb -f "$deb" Version)" = "$version" ] ||
    complain "$deb: is not of version $version, as CMakeLists.txt and its release say; look at packaging/debian/changelog"
  depends=$(dpkg-deb -f "$deb" Depends)
  ! grep -qE 'vtk|pcl-io|boost|ros' <<<"$depends" || complain "$deb: has large dependencies: $depends"
  [ $package = locus-tools ] || ! grep -q pcl <<<"$depends" || complain "$deb: needs PCL: $depends"
  ! dpkg-deb --fsys-tarfile "$deb" | grep -aE 'locusd-deb\.' >/dev/null ||
    complain "$deb: names the folder that it was built in"
done
diff <(dpkg-deb -I "$folder"/locusd_*.deb conffiles | sort) \
  <(cd "$source/config" && printf '/etc/locusd/%s\n' *.yaml | sort) || complain "conffiles are not those of config/ (>)"
exit $status
