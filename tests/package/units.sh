#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# units.sh SOURCE BUILD: systemd-analyze reports nothing about the units, including the drop-in, and the sandbox is
# strict.
set -euo pipefail
source=$1/systemd build=$2
work=$(mktemp -d)
trap 'rm -r "$work"' EXIT
cp "$source"/locusd.{service,socket} "$work"
cp "$build/systemd/locusd@.service" "$work/locusd@.service"
cp "$build/systemd/locusd@.service" "$work/locusd@front.service"
sed -i "s,/usr/bin/,$build/bin/," "$work"/*.service
status=0
verify() {
  local said
  said=$(systemd-analyze verify --man=no "$work"/locusd{,@front}.service "$work/locusd.socket" 2>&1) || status=1
  [ -z "$said" ] || { echo "$said"; status=1; }
}
verify
for unit in locusd.service locusd@front.service; do
  systemd-analyze security --offline=yes --threshold=20 "$work/$unit" | tail -n 1
done
grep -q '^ExecStart=.* --config /etc/locusd/%i.yaml$' "$work/locusd@.service"
grep -q '^RuntimeDirectory=locusd@%i$' "$work/locusd@.service"
grep -q '^StateDirectory=locusd@%i$' "$work/locusd@.service"

mkdir "$work/locusd.service.d"
cp "$source/realtime.conf" "$work/locusd.service.d"
verify

# The kernel limit permits the buffer size that the sockets request.
asked=$(sed -n 's/.*kWantedBufferBytes = \(.*\);.*/\1/p' "$1/drivers/net/udp_socket.hpp")
grep -q "^net.core.rmem_max = $((asked))$" "$source/sysctl.conf" ||
  { echo "systemd/sysctl.conf: rmem_max is not kWantedBufferBytes = $asked"; status=1; }
systemd-sysusers --dry-run --root="$work" "$source/sysusers.conf" 2>&1 | grep "locusd" >/dev/null ||
  { echo "systemd/sysusers.conf: makes no user locusd"; status=1; }
exit $status
