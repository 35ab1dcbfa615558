# SPDX-License-Identifier: Apache-2.0
# To be sourced. The releases of Debian that packages are built for, and how their versions tell them: as Debian's own do
# where one version goes to several releases (firefox-esr, chromium), so that an upgrade of the distribution, from
# 0.1.0~deb12u1 to 0.1.0~deb13u1, upgrades the package.
declare -A release_of=([bookworm]=12 [trixie]=13)

suffix_of() { echo "~deb${release_of[$1]}u1"; } # SUITE

suite_of_version() {
  local suite
  for suite in "${!release_of[@]}"; do
    [[ $1 != *~deb"${release_of[$suite]}"u* ]] || { echo "$suite"; return; }
  done
  return 1
}
