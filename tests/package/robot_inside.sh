#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Robot side of robot.sh: runs on a freshly booted Debian system with systemd.
set -Eeuo pipefail
trap 'echo "FAILED in line $LINENO: $BASH_COMMAND"; systemctl status --no-pager locusd; journalctl --no-pager -u locusd | tail -n 40' ERR
cd /exchange
export DEBIAN_FRONTEND=noninteractive

step() { echo "-- $*"; }
# wait_for SECONDS COMMAND...: waits until it succeeds.
wait_for() {
  local end=$((SECONDS + $1))
  shift
  until "$@"; do
    [ $SECONDS -lt $end ] || { echo "waited in vain for: $*"; return 1; }
    sleep 0.1
  done
}
install_package() { dpkg --force-confold --force-confdef -i "$1"; }
is() { [ "$(systemctl show -P "$2" locusd)" = "$1" ]; }
status_is() { locusctl status --json | grep -E "^ \"state\": \"($1)\"" >/dev/null; }
tracks() { status_is "tracking|standstill"; }
alive() { is active ActiveState && ! is "$1" MainPID; }
says() { journalctl --no-pager -u locusd --since "$1" | grep "$2" >/dev/null; }
# goes_on SINCE: waits until it has resumed from the saved state and tracks again.
goes_on() {
  wait_for 20 says "$1" "resumed from the saved state"
  wait_for 20 tracks
}
now() { date '+%Y-%m-%d %H:%M:%S.%N' | head -c 26; }

step "installing it enables and starts it, ready without a sensor"
install_package previous.deb
systemctl is-enabled --quiet locusd
is active ActiveState
is running SubState
wait_for 3 is "Waiting for the first lidar packet" StatusText
[ "$(stat -c %U "/proc/$(systemctl show -P MainPID locusd)")" = locusd ]
for unit in locusd@.service locusd.socket; do
  if systemctl is-enabled --quiet $unit; then false; fi
done

step "a reload accepts an edited configuration and rejects an invalid one"
cp robot.yaml /etc/locusd/locusd.yaml
systemctl reload locusd
wait_for 10 says -1min "DDS is up: domain 7 on interface uplink0"
echo "no_such_key: 1" >>/etc/locusd/locusd.yaml
if locusctl reload || systemctl reload locusd; then false; fi
is active ActiveState
cp robot.yaml /etc/locusd/locusd.yaml

step "silent sensors are reported"
wait_for 10 says -1min "lidar .*: no data packet on UDP port 2368"
wait_for 10 says -1min "motion source wio: nothing received"
for field in LOCUS_LIDAR LOCUS_SOURCE; do
  journalctl --no-pager -u locusd -o json | grep "\"$field\":\"" | grep '"CODE_FILE":"' | grep '"PRIORITY":"4"' >/dev/null
done

step "a socket buffer that is too small is reported with the setting"
buffer_is() { # at least this many bytes; the kernel reports twice the requested size
  [ "$(ss --udp --listening --numeric --memory --no-header 'sport = :2368' | grep -oP '\brb\K\d+')" -ge $(($1 * 2)) ]
}
buffer_is $((8 << 20)) || says -10min "sysctl net.core.rmem_max=$((8 << 20))"

touch waits_for_drive
step "an upgrade under way keeps edited files, replaces others, and resumes"
wait_for 30 status_is standstill # at the start
wait_for 30 status_is tracking
since=$(now)
process=$(systemctl show -P MainPID locusd)
date +%s.%N >upgrade
install_package "$(echo locusd_*.deb)"
date +%s.%N >>upgrade
cmp robot.yaml /etc/locusd/locusd.yaml
[ -e /etc/locusd/locusd.yaml.dpkg-dist ]
if grep -q "previous version" /etc/locusd/spot.yaml; then false; fi
wait_for 10 alive "$process"
[ "$(dpkg-query -W -f '${Version}' locusd)" != 0.0.1 ]
goes_on "$since"
locusctl status --json | grep '^ "beginning": "map"' >/dev/null
status_is tracking # not yet at its final position

step "the robot stands while its wheels spin"
spins() { status_is standstill && locusctl status | grep -E "^wio +lost" >/dev/null; }
wait_for 30 spins # wheels that begin to spin without lidar are trusted
locusctl status
locusctl save-map /tmp/map.pcd
[ -s /tmp/map.pcd ]
locusctl sensors | grep "192.168.1.201.*VLP-16" >/dev/null

step "input is recorded where the unit permits writing"
compgen -G "/var/lib/locusd/record/000001_*/000001/lidar.pcap" >/dev/null
[ "$(stat -c %U /var/lib/locusd/record)" = locusd ]

step "the unit permits incidents and metrics"
keeps() { incident=$(locusctl record --keep 10s); }
wait_for 10 keeps # an automatic one may be in progress
[ -s "$incident/why.json" ] && [ "$(dirname "$incident")" = /var/lib/locusd/incidents ]
exec 3<>/dev/tcp/127.0.0.1/9464
printf 'GET /metrics HTTP/1.1\r\n\r\n' >&3
grep '^locusd_incidents_kept_total [1-9]' <&3 >/dev/null
exec 3>&-

step "a hanging thread is killed by the watchdog, and the odometry resumes"
since=$(now)
process=$(systemctl show -P MainPID locusd)
./hang_thread "$process" odometry &
wait_for 20 says "$since" "Watchdog timeout"
wait_for 10 alive "$process"
goes_on "$since"
is_noticed() { # unless another one was recorded just before
  compgen -G "/var/lib/locusd/incidents/*_restart/why.json" >/dev/null ||
    locusctl status --json | grep -E '"suppressed": [1-9]' >/dev/null
}
wait_for 10 is_noticed

step "after a crash it resumes"
wait_for 20 spins
since=$(now)
process=$(systemctl show -P MainPID locusd)
kill -SEGV "$process"
wait_for 10 alive "$process"
goes_on "$since"
is 2 NRestarts

step "the sandbox is in effect: forbidden operations fail"
mkdir -p /etc/systemd/system/locusd@sandbox.service.d
cat >/etc/systemd/system/locusd@sandbox.service.d/probe.conf <<'UNIT'
[Service]
Type=oneshot
Restart=no
ExecStart=
ExecStart=/bin/bash /run/sandbox_probe.sh
UNIT
cat >/run/sandbox_probe.sh <<'PROBE'
refused() { if "$@" 2>/dev/null; then echo "was permitted: $*"; exit 1; fi; }
touch "$STATE_DIRECTORY/mine" "$RUNTIME_DIRECTORY/mine" || exit 1
for folder in /etc /etc/locusd /usr /var /var/lib/locusd /home /root /run /boot; do
  refused touch "$folder/mine"
done
refused perl -MSocket -e 'socket(my $s, AF_INET, SOCK_RAW, 1) or exit 1'
refused perl -MSocket -e 'socket(my $s, 17, SOCK_DGRAM, 0) or exit 1' # AF_PACKET
refused mount -t tmpfs none /mnt
refused unshare --user true
refused dmesg
perl -MSocket -e 'socket(my $s, AF_INET, SOCK_DGRAM, 0) or exit 1' || exit 1
PROBE
systemctl daemon-reload
systemctl start locusd@sandbox || { journalctl --no-pager -u locusd@sandbox; false; }
[ -e /var/lib/locusd@sandbox/mine ]
rm -r /etc/systemd/system/locusd@sandbox.service.d
systemctl daemon-reload

step "a second instance has its own file, socket and state"
sed 's/port: 2368/port: 2400/; s/domain: 7/domain: 8/' robot.yaml >/etc/locusd/second.yaml
systemctl start locusd@second
locusctl --instance second status --json | grep '"port": 2400' >/dev/null
[ -d /var/lib/locusd@second ]
process=$(systemctl show -P MainPID locusd@second)
dpkg-reconfigure locusd
[ "$(systemctl show -P MainPID locusd@second)" != "$process" ]
wait_for 5 locusctl --instance second status >/dev/null
if journalctl --no-pager -u locusd@second | grep "without position packets"; then false; fi # the port is shared

step "DDS Security works in the sandbox, with a key that only the service may read"
cp -r enclaves/locusd /etc/locusd/enclave
chown -R root:locusd /etc/locusd/enclave
chmod 750 /etc/locusd/enclave
chmod 640 /etc/locusd/enclave/*
sed 's/port: 2368/port: 2410/; s,domain: 7,domain: 9\, security: /etc/locusd/enclave,' robot.yaml >/etc/locusd/secured.yaml
systemctl start locusd@secured
is_secured() { journalctl --no-pager -u locusd@secured | grep "DDS is up: domain 9" >/dev/null; }
wait_for 10 is_secured
systemctl stop locusd@secured
rm -r /etc/locusd/enclave /etc/locusd/secured.yaml

step "with sockets held by systemd, packets are buffered through a restart"
systemctl stop locusd
systemctl start locusd.socket
systemctl start locusd
wait_for 20 tracks
buffer_is $((8 << 20))
systemctl stop locusd.socket
systemctl restart locusd
wait_for 20 tracks

step "a state saved before a reset is not restored"
touch /tmp/before_reset
locusctl reset --pose 100,0,0,0,0,90
wait_for 10 test /var/lib/locusd/state -nt /tmp/before_reset

step "removal stops it and keeps configuration and state"
dpkg -r locusd
if systemctl is-active --quiet locusd locusd@second; then false; fi
cmp robot.yaml /etc/locusd/locusd.yaml
[ -e /var/lib/locusd/state ]

step "reinstalled, it uses the edited configuration"
install_package "$(echo locusd_*.deb)"
cmp robot.yaml /etc/locusd/locusd.yaml
wait_for 20 tracks

step "a purge removes configuration and state"
dpkg -P locusd
[ ! -e /etc/locusd/locusd.yaml ]
[ ! -e /var/lib/locusd ] && [ ! -e /var/lib/locusd@second ] && [ ! -e /run/locusd ]

step "reinstalled after the purge, it has its defaults"
install_package "$(echo locusd_*.deb)"
systemctl is-enabled --quiet locusd
is active ActiveState
grep -q "^threads: 2 " /etc/locusd/locusd.yaml
step "done"
