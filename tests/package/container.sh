#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# container.sh SOURCE BIN: builds the image of packaging/Containerfile and runs locusd in it as documented: neither as
# root nor with a capability, without systemd. It receives a lidar, is received by ROS 2, and resumes when the container
# is recreated. Its base debian:trixie-slim is made by mmdebstrap; no registry is contacted.
set -euo pipefail
here=$(dirname "$(realpath "$0")")
source=$(realpath "$1") bin=$(realpath "$2")
source "$here/base_tree.sh"
probe
for program in podman crun; do
  command -v $program >/dev/null || skip "there is no $program; install podman and crun"
done

# Container engines support cgroup v2 only; a mount namespace without cgroup v1 suffices for a test.
[ -n "${LOCUSD_UNSHARED:-}" ] || LOCUSD_UNSHARED=1 exec unshare --mount "$0" "$@"
if [ "$(stat --file-system --format=%T /sys/fs/cgroup)" != cgroup2fs ]; then
  umount --recursive /sys/fs/cgroup && mount -t cgroup2 none /sys/fs/cgroup || skip "there are no cgroups of version 2"
fi

cache=${XDG_CACHE_HOME:-/var/cache}/locusd-tests
work=$(mktemp -d -t locusd-container.XXXXXX)
net=locusd-$$
podman=(podman --root "$work/storage" --runroot "$work/run" --storage-driver overlay --runtime crun)
engine() { "${podman[@]}" "$@"; }
clean_up() {
  kill $(jobs -p) 2>/dev/null || true
  engine rm --all --force >/dev/null 2>&1 || true
  ip netns del "$net" 2>/dev/null || true
  wait
  umount "$work/storage/overlay" 2>/dev/null || true
  rm -rf --one-file-system "$work"
}
trap clean_up EXIT

debian=docker.io/library/debian:trixie-slim
if [ ! -f "$cache/trixie-slim.tar" ]; then
  mkdir -p "$cache"
  mmdebstrap --quiet --variant=minbase --dpkgopt=force-unsafe-io trixie "$cache/trixie-slim.$$.tar" ||
    { rm -f "$cache/trixie-slim.$$.tar"; skip "mmdebstrap could not make a Debian trixie; is there a network?"; }
  mv "$cache/trixie-slim.$$.tar" "$cache/trixie-slim.tar"
fi
engine import --quiet "$cache/trixie-slim.tar" $debian || skip "podman cannot keep images here"
engine run --rm --pull=never --cgroups=disabled --network=host --ulimit nofile=1024:1024 --ulimit nproc=1000:1000 $debian true \
  >"$work/said" 2>&1 || { tail -n 3 "$work/said"; skip "containers cannot be run here, see above"; }

step() { echo "-- $*"; }
# wait_for SECONDS COMMAND...: waits until it succeeds.
wait_for() {
  local end=$((SECONDS + $1))
  shift
  until "$@"; do
    [ $SECONDS -lt $end ] || { echo "waited in vain for: $*"; engine logs locusd || true; exit 1; }
    sleep 0.2
  done
}

step "the image is built from files that git tracks"
mkdir "$work/source"
git -C "$source" ls-files -z | tar --create --directory="$source" --null --files-from=- | tar --extract --directory="$work/source"
compiled=$(ccache --get-config cache_dir)
mkdir -p "$compiled"
engine build --format docker --layers=false --isolation chroot --pull=never --volume "$compiled:/root/.cache/ccache" \
  --file "$work/source/packaging/Containerfile" --tag locusd "$work/source" >"$work/built" 2>&1 || { tail -n 40 "$work/built"; exit 1; }

step "it runs as documented, in a network in place of the host's"
ip netns add "$net"
host() { nsenter --net="/run/netns/$net" "$@"; } # ip netns exec would hide the cgroups
host ip link set lo up
"$bin/locus-sim" --world tunnel --robot husky --seed 1 --duration 60 --realism clean -o "$work/drive" >/dev/null 2>&1
mkdir "$work/etc"
cp "$work/drive/config.yaml" "$work/etc/locusd.yaml"
printf 'dds: {domain: 7}\n' >>"$work/etc/locusd.yaml"
chmod -R a+rX "$work/etc"
run() {
  host "${podman[@]}" run --detach --name locusd \
    --pull=never --cgroups=disabled --ulimit nofile=1024:1024 --ulimit nproc=1000:1000 \
    --network host --cap-drop all --security-opt no-new-privileges \
    --volume "$work/etc:/etc/locusd:ro" --volume locusd:/var/lib/locusd \
    --tmpfs /run/locusd:rw,size=640m,mode=1777 localhost/locusd >/dev/null
}
status() { engine exec locusd locusctl status --json 2>/dev/null; }
status_is() { status | grep -E "^ \"state\": \"($1)\"" >/dev/null; }
run
wait_for 20 status >/dev/null
process=$(engine inspect --format '{{.State.Pid}}' locusd)
[ "$(awk '$1 == "Uid:" {print $2}' "/proc/$process/status")" -ne 0 ]
[ "$(awk '$1 == "CapBnd:" {print $2}' "/proc/$process/status")" = 0000000000000000 ]

step "it receives a lidar and publishes odometry"
mkfifo "$work/open"
host "$bin/fast_dds_peer" 7 listen /locus <>"$work/open" >"$work/heard" 2>&1 &
host "$bin/locus-play" --quiet --to 127.0.0.1 --interface lo --domain 7 "$work/drive" >"$work/played" 2>&1 &
wait_for 20 status_is "tracking|standstill"
wait_for 20 grep -m 1 "^odometry" "$work/heard"
engine exec locusd locusctl status
engine exec locusd locusctl save-map /tmp/map.pcd # the user in the container may send commands
engine exec locusd locusctl record --keep 10s | grep "^/var/lib/locusd/incidents/"

step "a recreated container resumes at the robot's pose"
sleep 5 # time to save its state
engine stop --time 10 locusd >/dev/null
[ "$(engine inspect --format '{{.State.ExitCode}}' locusd)" = 0 ]
engine rm locusd >/dev/null
run
wait_for 20 status_is "tracking|standstill"
status | grep '^ "beginning": "map"'

step "an invalid configuration is reported and ends it"
echo "no_such_key: 1" >>"$work/etc/locusd.yaml"
engine stop locusd >/dev/null
engine start locusd >/dev/null
[ "$(timeout 10 "${podman[@]}" wait locusd)" = 2 ]
engine logs locusd 2>&1 | grep "no_such_key"
step "done"
