#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# robot.sh BIN FOLDER: tests the package locusd of FOLDER on a robot: a separate, booted Debian system with a lidar
# network and an uplink. This script is the rest of the world: it sends the data of the robot's sensors and receives its
# output. robot_inside.sh runs on the robot.
set -euo pipefail
here=$(dirname "$(realpath "$0")")
bin=$(realpath "$1") folder=$(realpath "$2")
source "$here/base_tree.sh"
probe
base=$(base_tree "$folder")

renice -n -15 -p $$ >/dev/null || true # prevents delays by other programs here

work=$(mktemp -d -t locusd-robot.XXXXXX)
net=locusd-$$
clean_up() {
  kill $(jobs -p) 2>/dev/null || true
  for side in robot world; do
    ip netns pids "$net-$side" 2>/dev/null | xargs --no-run-if-empty kill -KILL || true
    ip netns del "$net-$side" 2>/dev/null || true
  done
  wait
  umount "$work/root" 2>/dev/null || true
  rm -rf "$work"
}
trap clean_up EXIT

# Two networks, as on real robots: one for lidars, one for ROS 2.
ip netns add "$net-robot"
ip netns add "$net-world"
world() { ip netns exec "$net-world" "$@"; }
robot() { ip netns exec "$net-robot" "$@"; }
wire() { # NAME WORLD_ADDRESS ROBOT_ADDRESS
  world ip link add "$1" type veth peer name "$1" netns "$net-robot"
  world ip address add "$2" broadcast + dev "$1"
  robot ip address add "$3" broadcast + dev "$1"
  world ip link set "$1" up
  robot ip link set "$1" up
}
world ip link set lo up
robot ip link set lo up
wire lidar0 192.168.1.201/24 192.168.1.100/24
wire uplink0 10.7.0.2/24 10.7.0.1/24

# The robot stands, drives until 30 s have passed, then stands while its wheels spin.
"$bin/locus-sim" --world tunnel --robot husky --seed 1 --duration 120 --halts 0.5 --slip 30-120 --realism clean -o "$work/drive" >/dev/null 2>&1

# The package, an older one, and the script for the robot are in a folder visible to both sides.
exchange=$work/exchange
mkdir -p "$exchange" "$work"/{upper,overlay,root}
cp "$here/robot_inside.sh" "$bin/hang_thread" "$folder"/locusd_*.deb "$exchange"
cp "$work/drive/config.yaml" "$exchange/robot.yaml"
printf 'dds: {interface: uplink0, domain: 7}\nrecord: {folder: record}\nmetrics: {listen: "127.0.0.1:9464"}\n' >>"$exchange/robot.yaml"
"$here/../../docs/examples/dds-security.sh" "$exchange/enclaves" 9
dpkg-deb -R "$folder"/locusd_*.deb "$work/previous"
sed -i 's/^Version: .*/Version: 0.0.1/' "$work/previous/DEBIAN/control"
sed -i 's/^threads: 2 /threads: 1 /' "$work/previous/etc/locusd/locusd.yaml"
echo "# of the previous version" >>"$work/previous/etc/locusd/spot.yaml"
dpkg-deb -b "$work/previous" "$exchange/previous.deb" >/dev/null

mount -t overlay overlay -o "lowerdir=$base,upperdir=$work/upper,workdir=$work/overlay" "$work/root"
cat >"$work/root/etc/systemd/system/robot-test.service" <<UNIT
[Service]
Type=idle
ExecStart=/bin/bash -c '/exchange/robot_inside.sh >/exchange/log 2>&1; systemctl exit \$\$?'
[Install]
WantedBy=multi-user.target
UNIT
ln -s ../robot-test.service "$work/root/etc/systemd/system/multi-user.target.wants/robot-test.service"

mkfifo "$work/open"
world "$bin/fast_dds_peer" 7 listen /locus 10.7.0.2 <>"$work/open" >"$work/heard" 2>&1 &
SYSTEMD_NSPAWN_UNIFIED_HIERARCHY=1 systemd-nspawn --quiet --directory="$work/root" --bind="$exchange:/exchange" \
  --register=no --keep-unit --capability=all --network-namespace-path="/run/netns/$net-robot" --boot --console=pipe \
  </dev/null >"$work/console" 2>&1 &
robot_process=$!

(
  until [ -e "$exchange/waits_for_drive" ]; do sleep 0.2; done
  while true; do
    world "$bin/locus-play" --quiet --to 192.168.1.255 --interface uplink0 --domain 7 "$work/drive"
  done
) >"$work/played" 2>&1 &

status=0
wait "$robot_process" || status=$?
cat "$exchange/log" 2>/dev/null || cat "$work/console"
[ $status -eq 0 ] || { echo "robot_inside.sh ended with $status"; tail "$work/played" "$work/heard"; exit 1; }

# The output received outside is correct, also through the upgrade in mid-drive: the final position after 35 s is within
# 10 cm relative to the start, and the upgrade interrupts the odometry for 1.5 s at most.
awk '
  function way(x, y, z) { return sqrt(x * x + y * y + z * z) }
  FILENAME ~ /upgrade/ { upgrade[FNR] = $1; next }
  FILENAME ~ /gt.tum/ && !first { first = $1; x = $2; y = $3; z = $4 }
  FILENAME ~ /gt.tum/ { if ($1 - first <= 35) truth = way($2 - x, $3 - y, $4 - z); next }
  $1 == "odometry" {
    if (!start) start = $2
    if ($2 - start <= 35) heard = way($3, $4, $5)
    arrived = $NF / 1e9
    if (poses && arrived > upgrade[1] && last < upgrade[2] + 5 && arrived - last > missing_s) missing_s = arrived - last
    last = arrived
    poses++
  }
  $1 == "state" { states++ }
  $1 == "diagnostics" { diagnostics++ }
  END {
    printf "outside: %d poses, %d states, %d diagnostics; after 35 s %.2f m away, in truth %.2f m; for the upgrade, of %.2f s," \
      " odometry was missing for %.2f s\n", poses, states, diagnostics, heard, truth, upgrade[2] - upgrade[1], missing_s
    exit !(poses > 150 && states > 150 && diagnostics > 20 && truth > 10 && (heard - truth) ^ 2 < 0.1 ^ 2 &&
      missing_s > 0.1 && missing_s <= 1.5)
  }' "$exchange/upgrade" "$work/drive/gt.tum" "$work/heard"
