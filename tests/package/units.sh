#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# units.sh SOURCE BUILD: systemd-analyze reports nothing about the units, including the drop-in, the sandbox is strict,
# and no unit starts again and again for nothing.
set -euo pipefail
source=$1/systemd build=$2
work=$(mktemp -d)
trap 'rm -r "$work"' EXIT
cp "$source"/locusd.{service,socket} "$work"
cp "$build/systemd/locusd@.service" "$work/locusd@.service"
cp "$build/systemd/locusd@.service" "$work/locusd@front.service"
sed -i "s,/usr/bin/locus,$build/bin/locus," "$work"/*.service
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
grep -q '^Environment=STATE_DIRECTORY=/var/lib/locusd@%i$' "$work/locusd@.service"
grep -q '^ReadWritePaths=-/var/lib/locusd@%i$' "$work/locusd@.service"

# The service starts without user namespaces and with a read-only /var, and systemd does not repeat a start that fails
# for good.
! grep -E '^(PrivateUsers|StateDirectory)=' "$work"/locusd*.service ||
  { echo "a unit refuses to start where /var is read-only or the kernel has no user namespaces"; status=1; }
grep -q '^ExecStartPre=-+/usr/bin/install -d .* /var/lib/locusd@%i$' "$work/locusd@.service"
grep -qE '^RestartPreventExitStatus=2 .*\b217\b.*\b226\b' "$work/locusd.service"

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
