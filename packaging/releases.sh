# SPDX-License-Identifier: Apache-2.0
# Supported Debian releases and their version suffixes; to be sourced. The suffixes follow Debian's own practice for one
# version in several releases (firefox-esr, chromium), so that an upgrade of the distribution upgrades the package, from
# 0.1.0~deb12u1 to 0.1.0~deb13u1.
declare -A release_of=([bookworm]=12 [trixie]=13)

suffix_of() { echo "~deb${release_of[$1]}u1"; } # SUITE

suite_of_version() {
  local suite
  for suite in "${!release_of[@]}"; do
    [[ $1 != *~deb"${release_of[$suite]}"u* ]] || { echo "$suite"; return; }
  done
  return 1
}
