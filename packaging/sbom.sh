#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# sbom.sh PACKAGE TREE BUILD: prints the SBOM of a package's programs or library, as SPDX 2.3. TREE is the installation
# tree, BUILD the ninja folder in which they were linked. All entries are derived from the actual build:
#   DYNAMIC_LINK              package of a library that a program needs directly
#   RUNTIME_DEPENDENCY_OF     package of a library that only other libraries need
#   BUILD_DEPENDENCY_OF       package whose headers were compiled in
#   CONTAINS                  package whose scripts are bundled into a page
# Reproducible for the same Debian packages; the time is SOURCE_DATE_EPOCH.
set -euo pipefail
export LC_ALL=C.UTF-8
package=$1 tree=$(realpath "$2") build=$(realpath "$3")
arch=$(dpkg-architecture -q DEB_HOST_ARCH) triplet=$(dpkg-architecture -q DEB_HOST_MULTIARCH)
version=$(dpkg-parsechangelog -S Version)
mapfile -t programs < <(find "$tree"/usr -path "*/usr/bin/*" -o -type f -name "*.so*" | sort)

needed() { readelf --dynamic "$@" | sed -n 's/.*(NEEDED).*\[\(.*\)\]/\1/p' | sort -u; }
path_of() { # LIBRARY: prints its path, in the loader's search order
  local folder
  for folder in {,/usr}/lib{/"$triplet",,64} "/usr/$triplet/lib"; do
    [ ! -e "$folder/$1" ] || { realpath "$folder/$1"; return; }
  done
  echo "sbom.sh: $1: no such library in /lib/$triplet; is its package installed?" >&2
  return 1
}
# Prints "PACKAGE FILE" for files that belong to Debian packages.
owners() { { xargs --no-run-if-empty dpkg -S 2>/dev/null || true; } | sed -E 's/^([^:,]+).*: /\1 /'; }
related() { owners | sed "s/^\([^ ]*\) .*/$1 \1/" | sort -u; } # "RELATION PACKAGE"

libraries() {
  local -A seen=()
  local wave relation=DYNAMIC_LINK library path
  wave=$(needed "${programs[@]}")
  while [ -n "$wave" ]; do
    local next=()
    for library in $wave; do
      [ -z "${seen[$library]:-}" ] || continue
      seen[$library]=1
      path=$(path_of "$library")
      # dpkg knows a library by the path in its package, which may be without the merged /usr.
      printf '%s\n%s\n' "$path" "${path#/usr}" | owners | sed "s,^\([^ ]*\) .*,$relation \1 $library," | grep . ||
        { echo "sbom.sh: $path: of no package of Debian" >&2; return 1; }
      next+=("$path")
    done
    relation=RUNTIME_DEPENDENCY_OF
    wave=$([ ${#next[@]} -eq 0 ] || needed "${next[@]}")
  done
}

# Prints the inputs, except order-only ones, of the ninja targets on standard input.
made_of() { (cd "$build" && xargs --no-run-if-empty ninja -t query) | awk '/^  input:/ {on = 1; next} /^  outputs:/ {on = 0}
  on && $1 != "||" {print $NF}'; }
# Prints "SYMBOL FILE". A shared library has LOCAL internal symbols.
symbols() { awk -v binding="$1" '/^File:/ {file = $2} $5 ~ binding && $7 != "UND" {print $8, file}'; }
candidates() { # prints all objects, including those of static libraries
  local wave
  wave=$(cd "$build" && for program in "${programs[@]}"; do ls -d {bin,lib}/"$(basename "$program")" 2>/dev/null || true; done)
  while [ -n "$wave" ]; do
    wave=$(made_of <<<"$wave" | sort -u)
    grep '\.o$' <<<"$wave" || true
    wave=$(grep '\.a$' <<<"$wave" | grep -v '^/' || true)
  done | sort -u
}
linked() { # prints the objects linked into a program, identified by their symbols
  local binding=GLOBAL
  [[ ${programs[0]} != *.so* ]] || binding='GLOBAL|LOCAL'
  (cd "$build" && awk 'FNR == NR {linked[$1]; next} $1 in linked {print $2}' <(readelf --syms --wide "${programs[@]}" | symbols "$binding") \
    <(candidates | xargs readelf --syms --wide | symbols GLOBAL)) | sort -u
}
headers() {
  linked | (cd "$build" && xargs --no-run-if-empty ninja -t deps) | grep -oE '/usr/include/.*' | sort -u | related BUILD_DEPENDENCY_OF
}
scripts() {
  linked | { grep 'page\.S\.o$' || true; } | made_of | { grep '\.html$' || true; } | sed 's/html$/js.meta.json/' |
    (cd "$build" && xargs --no-run-if-empty cat) | { grep -oE 'usr/share/[^"]+' || true; } | sed 's,^,/,' | sort -u |
    related CONTAINS
}

{ libraries; headers; scripts; } | sort -u | while read -r relation name library; do
  printf '%s\t%s\t%s\t%s\n' "$relation" "$name" "$(dpkg-query -W -f '${Version}\t${Architecture}' "$name:$arch" \
    2>/dev/null || dpkg-query -W -f '${Version}\t${Architecture}' "$name")" "$library"
done | sort -u | jq --raw-input --slurp --sort-keys --arg package "$package" --arg version "$version" --arg arch "$arch" \
  --argjson time "${SOURCE_DATE_EPOCH:-$(dpkg-parsechangelog -S Timestamp)}" '
  def id: "SPDXRef-Package-" + gsub("[^A-Za-z0-9.-]"; "-");
  def described: {downloadLocation: "NOASSERTION", filesAnalyzed: false, copyrightText: "NOASSERTION",
                  licenseConcluded: "NOASSERTION"};
  [split("\n")[] | select(. != "") | split("\t") | {relation: .[0], name: .[1], version: .[2], arch: .[3], shared_object: .[4]}] as $parts |
  {
    spdxVersion: "SPDX-2.3", dataLicense: "CC0-1.0", SPDXID: "SPDXRef-DOCUMENT",
    name: "\($package)_\($version)_\($arch)",
    documentNamespace: "https://locusd.example.org/spdx/\($package)_\($version)_\($arch)",
    creationInfo: {created: ($time | todate), creators: ["Tool: locusd-packaging-sbom.sh"]},
    packages: ([{SPDXID: ($package | id), name: $package, versionInfo: $version, licenseDeclared: "Apache-2.0"} + described]
      + ($parts | group_by(.name) | map({
          SPDXID: (.[0].name | id), name: .[0].name, versionInfo: .[0].version, licenseDeclared: "NOASSERTION",
          supplier: "Organization: Debian",
          comment: ([.[].shared_object | select(. != "")] | unique | join(" ")),
          externalRefs: [{referenceCategory: "PACKAGE-MANAGER", referenceType: "purl",
            referenceLocator: "pkg:deb/debian/\(.[0].name)@\(.[0].version | @uri)?arch=\(.[0].arch)"}]} + described
        | if .comment == "" then del(.comment) else . end))),
    relationships: ([{spdxElementId: "SPDXRef-DOCUMENT", relationshipType: "DESCRIBES",
                      relatedSpdxElement: ($package | id)}]
      + ($parts | map({relation, name}) | unique | map(
          if .relation | endswith("_OF")
          then {spdxElementId: (.name | id), relationshipType: .relation, relatedSpdxElement: ($package | id)}
          else {spdxElementId: ($package | id), relationshipType: .relation, relatedSpdxElement: (.name | id)} end)))
  }'
