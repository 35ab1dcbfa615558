#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# sbom.sh FOLDER: the software bill of materials of each package is complete: every library that its programs need, in
# the required version or a newer one, and everything compiled in.
set -euo pipefail
folder=$1
work=$(mktemp -d)
trap 'rm -r "$work"' EXIT
status=0
complain() { echo "$*"; status=1; }
for package in locusd locus-tools liblocus0; do
  deb=$(echo "$folder/${package}"_*.deb)
  dpkg-deb -x "$deb" "$work/$package"
  sbom=$work/$package/usr/share/doc/$package/$package.spdx.json
  jq -e '.spdxVersion == "SPDX-2.3" and .creationInfo.created != null and
    ([.packages[].SPDXID, .SPDXID] as $ids | ($ids | unique | length) == ($ids | length) and
      all(.relationships[]; [.spdxElementId, .relatedSpdxElement] - $ids == []))' "$sbom" >/dev/null ||
    complain "$sbom: is no SPDX 2.3, or its relations lead nowhere"
  jq -r '.packages[].comment // "" | split(" ")[]' "$sbom" | sort >"$work/named"
  find "$work/$package/usr" -type f \( -path '*/usr/bin/*' -o -name '*.so*' \) -print0 | xargs -0 readelf --dynamic |
    sed -n 's/.*(NEEDED).*\[\(.*\)\]/\1/p' | sort -u >"$work/needed"
  [ -s "$work/needed" ] || complain "$deb: its programs need no library; is this test out of date?"
  missing=$(comm -23 "$work/needed" "$work/named")
  [ -z "$missing" ] || complain "$sbom: lacks" "$missing"
  for library in $(dpkg-deb -f "$deb" Depends | grep -oP '(?<![a-z0-9.+-])z?lib[a-z0-9.+-]+(?= \(>=)'); do
    least=$(dpkg-deb -f "$deb" Depends | grep -oP "(?<![a-z0-9.+-])\Q$library\E \(>= \K[^)]*")
    version=$(jq -r --arg name "$library" '.packages[] | select(.name == $name).versionInfo' "$sbom")
    dpkg --compare-versions "${version:-0~}" ge "$least" || complain "$sbom: $library is '$version', needed is $least"
  done
  for header_only in libeigen3-dev nlohmann-json3-dev; do
    jq -e --arg name $header_only 'any(.packages[]; .name == $name)' "$sbom" >/dev/null ||
      complain "$sbom: lacks $header_only, which is compiled in"
  done
done
for package in locusd locus-tools; do
  for script in libjs-three node-d3-scale; do
    jq -e --arg id "SPDXRef-Package-$script" 'any(.relationships[]; .relationshipType == "CONTAINS" and
      .relatedSpdxElement == $id)' "$work/$package/usr/share/doc/$package/$package.spdx.json" >/dev/null ||
      complain "$package.spdx.json: does not contain $script, which a page is drawn with"
  done
done
exit $status
