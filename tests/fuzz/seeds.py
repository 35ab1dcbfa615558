#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""seeds.py FOLDER: writes an initial corpus to FOLDER/TARGET/: one well-formed input per supported format, inputs with
each key of the configuration and each number of a motion file set to nonsense, and inputs for gaps that coverage.sh showed."""
import bz2
import ctypes
import gzip
import json
import lzma
import math
import pathlib
import re
import struct
import sys

folder = pathlib.Path(sys.argv[1])
project = pathlib.Path(__file__).resolve().parents[2]


def write(target, name, content):
    (folder / target).mkdir(parents=True, exist_ok=True)
    (folder / target / name).write_bytes(content.encode() if isinstance(content, str) else content)


# Data packets: model, product id, banks, column duration in ns.
MODELS = [("vlp16", 0x22, 1, 110592), ("hires", 0x24, 1, 110592), ("vlp32c", 0x28, 1, 55296),
          ("hdl32e", 0x21, 1, 46080), ("vls128", 0xA1, 4, 53300)]
BANK_FLAGS = [0xEEFF, 0xDDFF, 0xCCFF, 0xBBFF]
NEW, OTHER_LENGTH, TRUNCATED, OTHER_SENDER, POSITION, ANY_TIME = 1, 2, 4, 8, 16, 32


def data_packet(product, mode, banks, column_ns):
    returns = 2 if mode == 0x39 else 1
    blocks = b""
    for block in range(12):
        column = block // (banks * returns)
        azimuth = int(column * column_ns * 1e-9 * 10 * 36000) % 36000
        channels = b"".join(struct.pack("<HB", 500 + 7 * channel + block % 2, 9) for channel in range(32))
        blocks += struct.pack("<HH", BANK_FLAGS[block % (banks * returns) // returns], azimuth) + channels
    return blocks + struct.pack("<IBB", 3599_990_000, mode, product)


def position_tail():
    body = "GPRMC,105500,A,4807.038,N,01131.000,E,022.4,084.4,200926,003.1,W"
    checksum = 0
    for c in body.encode():
        checksum ^= c
    sentence = f"${body}*{checksum:02X}\r\n".encode()
    return struct.pack("<IB3x", 3599_990_000, 2) + sentence


def again(later_us, turn_cdeg, step=0):
    return struct.pack("<BHH", step, later_us, turn_cdeg)


position = bytes(0xC6) + position_tail()
position += bytes(512 - len(position))
for index, (name, product, banks, column_ns) in enumerate(MODELS):
    for mode in (0x37, 0x38, 0x39):
        packet = data_packet(product, mode, banks, column_ns)
        columns = 12 // (banks * (2 if mode == 0x39 else 1))
        later_us = columns * column_ns // 1000
        stream = struct.pack("<BH", NEW, later_us) + packet
        stream += again(later_us, later_us * 36 // 100) * 12
        for kind in (0, 1 + index):
            write("data_packets", f"{name}_{mode:x}_{kind}", bytes([kind]) + stream)
packet = struct.pack("<BH", NEW, 1327) + data_packet(0x22, 0x37, 1, 110592)
turns = again(1327, 477) * 4
write("data_packets", "synchronised", b"\0" + struct.pack("<BH", NEW | POSITION, 10) + position + packet + turns)
write("data_packets", "duplicate", b"\0" + packet + again(0, 0) * 3)
write("data_packets", "lost", b"\0" + packet + turns + again(39810, 14310) + turns)
write("data_packets", "step", b"\6" + packet + turns + again(65535, 0) * 3 + again(1327, 477) * 8)
write("data_packets", "strangers", b"\0" + packet + turns + again(1327, 477, OTHER_SENDER) + again(0, 0, TRUNCATED))
write("data_packets", "any_time", b"\0" + packet + struct.pack("<BQHH", ANY_TIME, 8_999_999_999_999_999_999, 1, 1) + turns)
standing = bytearray(data_packet(0x22, 0x37, 1, 0))
standing[7 * 100 + 2] = 1
write("data_packets", "standing", b"\0" + struct.pack("<BH", NEW, 1327) + standing)
write("data_packets", "length", b"\0" + struct.pack("<BHH", OTHER_LENGTH, 1205, 0) + turns)

# Packets of an Ouster of each kind: kind, then step, columns elapsed, number of changed bytes (offset, value).
ANY_BYTES, UNSEALED, IMU, LATER = 1, 4, 8, 16
for kind in range(8):
    packets = b"".join(struct.pack("<BHB", LATER, 16, 0) for _ in range(6))
    changed = struct.pack("<BHBHBHB", LATER, 16, 2, 40, 0, 500, 255)
    turn = struct.pack("<BHB", LATER, 1008, 1) + struct.pack("<HB", 4, 9)
    imu = bytes([IMU]) + struct.pack("<QQQ6f", 1, 2, 3, 0, 0, 1, 1, 2, 3)
    write("ouster_packets", f"stream_{kind}", bytes([kind]) + packets + changed + packets)
    write("ouster_packets", f"turns_{kind}", bytes([kind]) + turn * 4)
    write("ouster_packets", f"imu_{kind}", bytes([kind]) + imu * 3)
    write("ouster_packets", f"any_{kind}", bytes([kind, ANY_BYTES | UNSEALED]) + bytes(range(256)) * 20)

# Packets of a Hesai of each model, detected or configured: step, microseconds elapsed, return mode, azimuth, speed,
# firing sequence, number of changed bytes (offset, value).
OTHER_MODEL = 8
for model in range(8):
    for mode in range(4):
        packets = b"".join(struct.pack("<BHBHbBB", LATER, 200, mode, 72 * i, 60, i % 2, 0) for i in range(4))
        backwards = b"".join(struct.pack("<BHBHbBB", LATER, 200, mode, 9000 - 72 * i, -60, i % 2, 0) for i in range(4))
        changed = struct.pack("<BHBHbBBHBHB", LATER, 200, mode, 0, 60, 0, 2, 400, 255, 1060, 9)
        for told in (0, 1):
            write("hesai_packets", f"stream_{model}_{mode}_{told}", bytes([model, told]) + packets + changed + packets)
        write("hesai_packets", f"backwards_{model}_{mode}", bytes([model, 1]) + backwards + changed)
    for length in (0, 11, 13, 568, 839, 1095, 1127, 1262):
        write("hesai_packets", f"length_{model}_{length}", bytes([model, 1]) + struct.pack("<BBHbBBH", OTHER_LENGTH, 1, 0, 60, 0, 0, length))
    other = struct.pack("<BBBHbBB", OTHER_MODEL, (model + 1) % 8, 1, 0, 60, 0, 0)
    write("hesai_packets", f"other_{model}", bytes([model, 1]) + packets + other + packets)
    write("hesai_packets", f"any_{model}", bytes([model, 0]) + struct.pack("<BBHbB", ANY_BYTES | UNSEALED, 1, 0, 60, 0) + bytes(range(256)) * 8)

# Metadata in both forms, each key omitted and absurd.
OUSTER = {
    "sensor_info": {"prod_line": "OS-1-16", "prod_sn": "122201000998", "initialization_id": 7109750},
    "config_params": {"lidar_mode": "1024x10", "timestamp_mode": "TIME_FROM_PTP_1588", "udp_port_lidar": 7502, "udp_port_imu": 7503},
    "beam_intrinsics": {"beam_altitude_angles": [16 - 2 * i for i in range(16)], "beam_azimuth_angles": [1.5] * 16,
                        "lidar_origin_to_beam_origin_mm": 15.806, "beam_to_lidar_transform": [1, 0, 0, 15.806, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]},
    "imu_intrinsics": {"imu_to_sensor_transform": [1, 0, 0, 6.253, 0, 1, 0, -11.775, 0, 0, 1, 7.645, 0, 0, 0, 1]},
    "lidar_intrinsics": {"lidar_to_sensor_transform": [-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 36.18, 0, 0, 0, 1]},
    "lidar_data_format": {"pixels_per_column": 16, "columns_per_packet": 16, "columns_per_frame": 1024, "column_window": [0, 1023],
                          "udp_profile_lidar": "RNG15_RFL8_NIR8", "udp_profile_imu": "ACCEL32_GYRO32_NMEA", "header_type": "FUSA"},
    "imu_data_format": {"imu_measurements_per_packet": 8},
    "calibration_status": {},
}
flat = {key: value for section in OUSTER.values() for key, value in section.items()} | {"data_format": OUSTER["lidar_data_format"]}
write("ouster_metadata", "nested", json.dumps(OUSTER))
write("ouster_metadata", "flat", json.dumps(flat))
for section, keys in OUSTER.items():
    write("ouster_metadata", f"without_{section}", json.dumps({name: value for name, value in OUSTER.items() if name != section}))
    for key in keys:
        for index, odd in enumerate((None, -1, 1e300, 0.5, "", "RNG19_RFL8_SIG16_NIR16_DUAL", [], [1, 2], [0] * 16, {})):
            write("ouster_metadata", f"odd_{section}_{key}_{index}", json.dumps(OUSTER | {section: keys | {key: odd}}))

write("position_packets", "packet", position_tail())
write("position_packets", "sentence", position_tail()[8:])
write("position_packets", "glonass", b"$GNRMC,235960.99,V,,,,,,,010100,,,N*00\r\n")

write("sensor_clock", "regular", b"\0" + struct.pack("<BHh", 0, 1327, 40) * 40)
write("sensor_clock", "slow", b"\0" + struct.pack("<BHh", 0, 60000, -40) * 60)
write("sensor_clock", "step", b"\2" + struct.pack("<BHh", 0, 1327, 4) * 8 + struct.pack("<BHhI", 1, 1327, 0, 12345678)
      + struct.pack("<BHh", 0, 1327, 4) * 8)
write("sensor_clock", "sensor", b"\1" + struct.pack("<BHh", 8, 1327, 4) * 8 + struct.pack("<BHhQ", 2, 9, 9, 7 << 60) * 2
      + struct.pack("<BHh", 4, 1327, 4) * 8)

# Captures.
udp = struct.pack(">HHHH", 2368, 2368, 8 + 24, 0) + bytes(range(24))
ip = struct.pack(">BBHHHBBH4s4s", 0x45, 0, 20 + len(udp), 1, 0x4000, 64, 17, 0, bytes([192, 168, 1, 201]), b"\xff" * 4) + udp
loopback = struct.pack("<I", 2) + ip
FRAMES = {"ethernet": (1, bytes(12) + b"\x08\x00" + ip), "vlan": (1, bytes(12) + b"\x81\x00\x00\x05\x08\x00" + ip),
          "arp": (1, bytes(12) + b"\x08\x06" + bytes(28)), "ipv6": (1, bytes(12) + b"\x86\xdd" + bytes(40)),
          "sll": (113, bytes(14) + b"\x08\x00" + ip), "sll2": (276, b"\x08\x00" + bytes(18) + ip),
          "null": (0, loopback), "loop": (108, loopback[3::-1] + ip), "raw": (101, ip), "ipv4": (228, ip)}
for name, (link, frame) in FRAMES.items():
    for form, magic, order in (("us", 0xA1B2C3D4, "<"), ("ns", 0xA1B23C4D, "<"), ("swapped", 0xA1B2C3D4, ">")):
        record = struct.pack(order + "IIII", 1700000000, 7, len(frame), len(frame)) + frame
        head = struct.pack(order + "IHHiIII", magic, 2, 4, 0, 0, 65535, link)
        write("capture", f"{name}_{form}", head + record * 2)
    section = struct.pack("<IIIHHqI", 0x0A0D0D0A, 28, 0x1A2B3C4D, 1, 0, -1, 28)
    interface = struct.pack("<IIHHIHHB3xHHI", 1, 32, link, 0, 65535, 9, 1, 9, 0, 0, 32)
    padded = frame + bytes(-len(frame) % 4)
    size = 32 + len(padded)
    enhanced = struct.pack("<IIIIIII", 6, size, 0, 396000000, 7, len(frame), len(frame)) + padded + struct.pack("<I", size)
    simple = struct.pack("<III", 3, 16 + len(padded), len(frame)) + padded + struct.pack("<I", 16 + len(padded))
    write("capture", f"{name}_ng", section + interface + enhanced * 2 + simple)
snapped = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 40, 1) + struct.pack("<IIII", 1, 7, 40, 66) + FRAMES["ethernet"][1][:40]
write("capture", "snapped", snapped)

# Text.
for file in sorted((project / "config").glob("*.yaml")):
    plain = "".join(line + "\n" for line in file.read_text().split("\n") if line and not line.strip().startswith("#"))
    for index, section in enumerate(re.split(r"\n(?=\w)", plain)):  # whole files are slow
        write("config", f"{file.stem}_{index}", section)
write("config", "comma", ",lidars: []\n")
ODD = ["-1", "0", "7", "1e400", ".nan", "true", "word", "[]", "[1, 2]", "[-1, 2, x]", "{}", "{x: 1}", "~", '""', "*a", "'"]
for section in re.split(r"\n(?=\w)", re.sub(r"\s*#.*", "", (project / "config/locusd.yaml").read_text())):
    name = section.strip().split(":")[0]
    for place in re.finditer(r"(\w+):\s+(?=(\[[^\]]*\]|\{[^{}]*\}|[^\s,}]+))", section):  # a key and its value
        outer = {"lidars": "lidars.front", "motion_sources": "motion_sources.imu"}.get(name, name)
        if place[1] in ("xyz_m", "rpy_deg"):
            outer += ".T_base_lidar" if name == "lidars" else ".T_base_source"
        path = name if place[1] == name else f"{outer}.{place[1]}"
        for index, odd in enumerate(ODD):
            write("config", f"odd_{path}_{index}", section[:place.start(2)] + odd + section[place.end(2):] + "\n")
            write("config_values", f"odd_{path}_{index}", f"{path}={odd}")
# Each rule of a value on its own, satisfied and violated.
RULES = [("sweep_period_ms", "50"), ("sweep_period_ms", "5"), ("range_m", "[-1, 5]"), ("range_m", "[5, 2]"), ("range_m", "[0, 2000]"),
         ("range_m", "[1, 2, 3]"), ("range_m", "[1, inf]"), ("body_box", "{enabled: true, min_m: [1, 1, 1], max_m: [2, 2, 2]}"),
         ("body_box", "{enabled: true, min_m: [1, 1, 1], max_m: [2, 2, 0]}"), ("threads", "99999999999999999999"), ("threads", "2 "),
         ("lidars", "[]"), ("lidars", "[{name: front, source_ip: 192.168.1.201, multicast_ip: 239.1.2.3, calibration: a.yaml}]"),
         ("lidars", "[{source_ip: {}, multicast_ip: 10.0.0.1, port: 0, model: [], time: {}}]"), ("lidars", "[{name: total}]"),
         ("lidars", "[{name: a, port: 1, source_ip: 10.0.0.1}, {name: b, port: 1, source_ip: 10.0.0.2}, {name: c, port: 2}]"),
         ("lidars", "[{name: a, port: 1, source_ip: 10.0.0.1}, {name: a, port: 1, source_ip: 10.0.0.1}, {name: c, port: 1}]"),
         ("lidars", "[" + ", ".join(f"{{name: l{i}, port: {i + 1}}}" for i in range(17)) + "]"),
         ("lidars", "[{name: a, T_base_lidar: {xyz_m: [0, 0, 0], rpy_deg: [1, 90, 2]}}, {name: b, port: 7, T_base_lidar: {rpy_deg: [1, -90]}}]"),
         ("motion_sources", "[{name: gt, kind: odometry, topic: /a/b_1}, {name: imu, kind: odometry, topic: a, health_topic: //a}]"),
         ("motion_sources", "[" + ", ".join(f"{{name: m{i}, kind: imu, topic: /a/}}" for i in range(9)) + "]"),
         ("motion_sources", "[{name: wio, kind: odometry, T_base_source: {xyz_m: [1, 0, 0]}}]"),
         ("realtime", "{priority: 100, cpus: [0, 2000], lock_memory: 1}"), ("realtime", "{cpus: [0, 1]}"), ("realtime", "{cpus: 1}"),
         ("dds", "{interface: a_name_of_16_and, frame_odom: '', prefix: /a//b}"), ("dds", "{interface: '', frame_base: odom}"),
         ("dds", "{interface: 'a b', frame_base: '', domain: 233, flat_ground_topic: /1}"), ("dds", "{interface: eth0.1:2@3-4}"),
         ("record", "{folder: /x, max_bytes: 1}"), ("seed", "-1"), ("fusion", "queue"), ("record", ""), ("map", "word"), ("map", "{[a]: 1}")]
for index, (key, value) in enumerate(RULES):
    write("config", f"rule_{index}", f"{key}: {value}\n")
    write("config_values", f"rule_{index}", f"{key}={value}")
recorded = "record: {folder: /x}\nmotion_sources: [{name: gt, kind: odometry}, {name: imu, kind: odometry}, {name: wio, kind: odometry}]\n"
for index, text in enumerate((recorded, "seed: 1\nseed: 2\n", "map:\n\tkeyframe_m: 1\n", "map:\n  keyframe_m: 1\n keyframe_deg: 2\n", "lidars:\n - a: 1\n  - b\n",
                              "lidars:\n  - name: a\n b\n", "seed: a: b\n", "map: {keyframe_m: 1\nseed: 1\n", "range_m: [1, 2\nseed: 1\n", "seed: @\n", "seed: 1\n---\nseed: 2\n",
                              "seed: 1\n...\n", "? [a]\n: 1\n", "[]\n", "word\n", "~\n", "seed: !!int 1\n", "seed: !own 1\n", "%YAML 1.2\n---\nseed: 1\n", "%TAG ! x\n---\n",
                              "seed: |\n  1\n", "seed: >-\n  1\n", 'fusion: "\\x71ueue"\n', 'fusion: "\\u0071\\n\\q"\n', "fusion: 'qu''eue'\n", "seed: *none\n", "map: &m {<<: *m}\n",
                              "seed: 1 # why\n", "\ufeffseed: 1\n", "seed: \x01\n", "<<: {seed: 1}\n", "{a: b}: c\n", "seed: &a\n  1\n", "- seed\n")):
    write("config", f"text_{index}", text)
for index, text in enumerate(("x", "=1", "seed=[", "seed=@", ".seed=1", "seed.a=1", "lidars.9.port=1", "lidars.front.name.a=1", "lidars.=1", "map.=1", "none=1",
                              "range_m=[5, 2]\nbody_box.enabled=true", "seed=1\nrange_m=[5, 2]", "seed=x\nthreads=0", "record.folder=/x\nmotion_sources.wio.name=gt",
                              "lidars.front=word\nlidars.0.port=1", "motion_sources.imu.T_base_source.rpy_deg=[0, 90, 1]", "realtime.cpus=[3, 4]",
                              "dds.prefix=/a/b\ndds.frame_base=odom", "map={keyframe_m: 0}", "map.keyframe_m=1\nmap={keyframe_m: 0}")):
    write("config_values", f"text_{index}", text)
write("config_values", "port", "lidars.front.port=2369\nlidars.0.name=rear")
write("config_values", "list", "motion_sources=[{name: vio, kind: odometry, T_base_source: {xyz_m: [0, 0, 1], rpy_deg: [0, 90, 180]}}]")
write("config_values", "sweep", "sweep_period_ms=50")
write("config", "anchors", "lidars: &a\n  - {name: front, model: VLP-16}\nmotion_sources: *a\n")

lasers = "\n".join(f"- {{dist_correction: 0.0, horiz_offset_correction: 0.01, laser_id: {i}, rot_correction: 0.0, "
                   f"two_pt_correction_available: false, vert_correction: {0.01 * i - 0.02}, vert_offset_correction: 0.0}}"
                   for i in range(4))
angles = "Laser id,Elevation,Azimuth\n" + "".join(f"{i + 1},{14.5 - i},{-1.042 + i}\n" for i in range(4))
for name, content in (("hesai", angles), ("hesai_version", "EEFF,1,1\r\n" + angles.replace("Laser id", "Channel").replace("\n", "\r\n")),
                      ("hesai_hash", "\ufeff" + angles + "0123456789abcdef,,\n"), ("hesai_twice", angles + "1,0,0\n"), ("hesai_missing", angles + "9,0,0\n"),
                      ("hesai_odd", angles + "5,nan,1e999\n6,,\n")):
    write("calibration", name, content)
write("calibration", "short", f"num_lasers: 4\ndistance_resolution: 0.002\nlasers:\n{lasers}\n")

imu = "#t_ns,wx,wy,wz,ax,ay,az\n" + "".join(f"{1_700_000_000_000_000_000 + i * 5_000_000},0.0{i},0,0,0,0,9.8{i}\n" for i in range(8))
write("motion_files", "imu", imu)
write("motion_files", "attitude", "1,0,0,0,0,0,9.81,1,0,0,0\r\n2,nan,0,0,0,0,9.81,0,0,0,0\r\n")
write("motion_files", "tum", "".join(f"1700000000.{i}00000000 {i} 0.5 -1e-3 0 0 0 1\n" for i in range(8)))
write("motion_files", "numpy", "1.403636579763555527e+09 0 0 0 0 0 0.6 0.8\n.5e1\t1 2 3 0 0 0 +1\n-2. 1 2 3 0 0 0 1\n")
write("motion_files", "meta", "1,0,0,0,0,0,9.81\n3,0,0,0,0,0,9.81\n---\nt_ns,arrival_ns,covariance_scale\n1,4,1\n3,2,7.5\n")
write("motion_files", "meta_tum", "1e-9 0 0 0 0 0 0 1\n1e-9 1 0 0 0 0 0 1\n---\n1,2000,1\n1,1000,8\n")
for force in (1, 5, -9.81, 0):  # one second of an accelerometer in g, without gravity, upside down
    lines = [f"{i * 60_000_000},0,0,0,0,0,{force}\n" for i in range(1, 20)]
    write("motion_files", f"gravity_{force}", "".join(lines))
    write("motion_files", f"other_clock_{force}", "".join(lines) + "---\n" + "".join(f"{i * 60_000_000},{(i + 5000) * 60_000_000},1\n" for i in range(1, 20)))
write("motion_files", "stands", "".join(f"{i}.5 {min(i, 2) * 20} 0 0 0 0 0 -1\n" for i in range(6)) + "4.5 40 0 0 0 0 0 -1\n0.5 40 0 0 0 0 0 -1\n")
NUMBERS = ["", "x", "-", "+1", "-0", "1.", ".5", "1e5", "1e400", "1e-400", "nan", "-inf", "0x10", "1 ", "9223372036854775808", "1" * 40]
for form, comma, line in (("imu", ",", "1,0,0,0,0,0,9.81"), ("attitude", ",", "1,0,0,0,0,0,9.81,1,0,0,0"),
                          ("tum", " ", "1.5 0 0 0 0 0 0 1"), ("meta", ",", "1,4,1")):
    before = "1,0,0,0,0,0,9.81\n---\nt_ns,arrival_ns,covariance_scale\n" if form == "meta" else line + "\n"
    for column in range(len(line.split(comma))):
        for index, number in enumerate(NUMBERS):
            fields = line.split(comma)
            fields[column] = number
            write("motion_files", f"odd_{form}_{column}_{index}", before + comma.join(fields) + "\n")
stamps = [-3_999_999_999_999_999_999 + i for i in range(6)] + [3_999_999_999_999_999_999]
write("motion_files", "absurd_meta", "".join(f"{t},0,0,0,0,0,9.81\n" for t in stamps) + "---\n"
      + "".join(f"{t},{3_999_999_999_999_999_990 + i},1\n" for i, t in enumerate(stamps)))
write("motion_files", "absurd", "-3999999999999999999,0,0,0,0,0,9.81\n3999999999999999999,0,0,0,0,0,9.81\n")

PLY = "ply\nformat {} 1.0\ncomment a map\nelement vertex 2\nproperty {} x\nproperty {} y\nproperty {} z\nproperty uchar i\nend_header\n"
POINTS = ((1.0, 2.0, 3.0, 4), (-1.0, 0.5, float("nan"), 5))
for form, order in (("binary_little_endian", "<"), ("binary_big_endian", ">")):
    for real, code in (("float", "f"), ("double", "d")):
        data = b"".join(struct.pack(order + 3 * code + "B", *point) for point in POINTS)
        write("point_cloud", f"{form}_{real}", PLY.format(form, real, real, real).encode() + data)
write("point_cloud", "ascii", PLY.format("ascii", "float", "double", "float32") + "1 2 3 4\n-1e3 nan .5 5\n")
PCD = "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z h\nSIZE 4 4 8 4\nTYPE F F F U\nCOUNT 1 1 1 3\nWIDTH 2\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\nDATA {}\n"
write("point_cloud", "pcd_ascii", PCD.format("ascii") + "1 2 3 4 5 6\n7 8 9 10 11 12\n")
packed = b"\x1f" + bytes(range(32)) + b"\xe0\x0f\x00"  # one byte repeated 24 times
write("point_cloud", "pcd_compressed", PCD.format("binary_compressed").encode() + struct.pack("<II", len(packed), 56) + packed)
write("point_cloud", "pcd_binary", PCD.format("binary").encode() + struct.pack("<ffdIII", 1, 2, 3, 4, 5, 6) * 2)

# The state of the service; the target corrects the checksums.
POSE = (1, 2, 3, 0, 0, 0, 1)
COVARIANCE_OF_ONE = [float(i % 7 == 0) for i in range(36)]
LEARNED = [0.1] * 6 + [0.0] * 7 + [1e-4 * (i % 8 == 0) for i in range(49)]
heads = b"".join(b"locusd 8" + struct.pack("<Qq7d36d6d56d496d8qQQ", number, 1_700_000_000_000_000_000, *POSE, *COVARIANCE_OF_ONE,
                                           1, 0, 0, 0, 0, 0.1, *POSE, *([0] * 49), *LEARNED, *([0] * 434), *([0] * 8), 1, 0)
                 for number in (0, 1))
for points in (0, 3):
    write("saved_state", f"points_{points}",
          heads + struct.pack("<Q8QiIQ", 7, *range(8), 1, points, 0) + struct.pack("<6f", 1, 2, 3, 0, 0, 1) * points)

# Messages; the target documents the content of each step.
ODOMETRY, STAMP, ARRIVAL, ROTATION, VECTORS, COVARIANCE, OUTSIDE = 1, 2, 4, 8, 16, 32, 64
drive = struct.pack("<BHddddddd", ODOMETRY | ROTATION | VECTORS, 20000, 0, 0, 0, 1, 1, 2, 3)
drive += b"".join(struct.pack("<BHddd", ODOMETRY | VECTORS, 20000, 1 + 0.01 * i, 2, 3) for i in range(8))
write("ros_messages", "odometry", drive)
write("ros_messages", "uncertain", drive + struct.pack("<BHBd", ODOMETRY | COVARIANCE, 20000, 7, 0.01) * 3)
turn = struct.pack("<BHddddddddddd", ROTATION | VECTORS | COVARIANCE, 5000, 0, 0, 0, 1, 0.1, 0, 0, 0, 0, 9.81, 0.1)
turn += b"".join(struct.pack("<BHdddddd", VECTORS, 5000, 0.1 + 0.01 * i, 0, 0, 0, 0.01, 9.8) for i in range(8))
write("ros_messages", "imu", turn)
for force in (1, 5, -9.81, 0):  # one second of an accelerometer in g, without gravity, upside down
    write("ros_messages", f"gravity_{force}", struct.pack("<BH6d", VECTORS, 60000, 0, 0, 0, 0, 0, force) + struct.pack("<BH", 0, 60000) * 19)
write("ros_messages", "no_attitude", struct.pack("<BHd", COVARIANCE, 5000, -1.0) + turn)
for index, numbers in enumerate(((float("inf"),), (float("-inf"),), (1e308, 1e308), (0.01, 1e308, 1e308))):
    write("ros_messages", f"covariance_{index}",
          drive + b"".join(struct.pack("<BHBd", ODOMETRY | COVARIANCE, 20000, 7 * i, number) for i, number in enumerate(numbers)))
write("ros_messages", "stands", drive + struct.pack("<BH", ODOMETRY, 20000) * 40)
write("ros_messages", "jumps", drive + struct.pack("<BHddd", ODOMETRY | VECTORS, 20000, 1000, 2, 3) * 2)
write("ros_messages", "late", drive + struct.pack("<BHiI", ODOMETRY | STAMP, 20000, 1_000_000_000, 7) * 8 + drive)
write("ros_messages", "host_clock_back", turn + drive + struct.pack("<BHI", ODOMETRY | ARRIVAL, 0, 1_600_000_000) + drive + turn)
write("ros_messages", "both", turn + drive + struct.pack("<BHB", ODOMETRY | OUTSIDE, 9, 1))
write("ros_messages", "own_clock", b"".join(struct.pack("<BHiIdddddd", STAMP | VECTORS, 5000, 5, i * 5_000_000, i, 0, 0, 0, 0, 9.81)
                                           for i in range(9)) + struct.pack("<BHI", ARRIVAL, 1, 7))

# ROS 1 bags and their messages: ROS 1 packs its numbers, CDR aligns them after the 4-byte header.


def text(value):
    return struct.pack("<I", len(value)) + value


def record(op, data=b"", **fields):
    header = text(b"op=" + bytes([op])) + b"".join(text(name.encode() + b"=" + value) for name, value in fields.items())
    return text(header) + text(data)


def lz4(data):
    library = ctypes.CDLL("liblz4.so.1")
    library.LZ4F_compressFrame.restype = ctypes.c_size_t
    out = ctypes.create_string_buffer(len(data) + 1000)
    size = library.LZ4F_compressFrame(out, len(out), data, len(data), None)
    return out.raw[:size]


def connection(number, topic, kind):
    return record(7, text(b"topic=" + topic) + text(b"type=" + kind), conn=struct.pack("<I", number), topic=topic)


for name, request in (("status", '{"command": "status"}'), ("view", '{"command": "view"}'), ("map", '{"command":"save-map"}'), ("reload", '{"command": "reload"}'),
                      ("reset", '{"command": "reset"}'), ("there", '{"command": "reset", "pose": [1.5, -2e3, 0, 0, 0, 90]}'),
                      ("far", '{"pose": [1e300, 0, 0, 0, 0, 361], "command": "reset"}'), ("other", '{"command": "dan\\u0063e", "a": {"b": [null, true]}}'),
                      *((mode, f'{{"command": "flat-ground", "mode": "{mode}"}}') for mode in ("on", "off", "auto", "maybe"))):
    write("control_requests", name, request)

STAMP_AND_FRAME = struct.pack("<II", 1_700_000_000, 5) + text(b"base")
BODIES = [struct.pack("<37d", *range(37)), text(b"odom") + struct.pack("<85d", *range(85)),
          struct.pack("<III", 1, 1_700_000_000, 7) + data_packet(0x22, 0x37, 1, 110592),
          struct.pack("<IIII", 1, 1_700_000_000, 7, 40) + bytes(range(40))]
ros1 = [struct.pack("<I", 1) + STAMP_AND_FRAME + body for body in BODIES]
cdr_head = struct.pack("<4BIII5s3x", 0, 1, 0, 0, 1_700_000_000, 5, 5, b"base")
cdr = [cdr_head + bytes(4) + BODIES[0], cdr_head + struct.pack("<I5s3x", 5, b"odom") + BODIES[1][8:], cdr_head + BODIES[2], cdr_head + BODIES[3]]
for kind in range(4):
    write("bag_messages", f"ros1_{kind}", bytes([2 * kind]) + ros1[kind])
    write("bag_messages", f"cdr_{kind}", bytes([2 * kind + 1]) + cdr[kind])
pandar = struct.pack("<III", 1, 1_700_000_000, 7) + bytes(range(250)) * 6 + struct.pack("<I", 1262)
frame = struct.pack("<IIII", 1, 1_700_000_000, 7, 40) + bytes(range(40)) + struct.pack("<I", 40)
for kind, body in ((8, pandar), (9, frame)):
    write("bag_messages", f"ros1_{kind}", bytes([2 * (kind - 2)]) + struct.pack("<I", 1) + STAMP_AND_FRAME + body)
    write("bag_messages", f"cdr_{kind}", bytes([2 * (kind - 2) + 1]) + cdr_head + body)
bare = struct.pack("<II", 1, 1) + STAMP_AND_FRAME + frame[4:]
write("bag_messages", "ros1_bare", bytes([14]) + bare)
pose = struct.pack("<7d", 1, 2, 3, 0, 0, 0.6, 0.8)
links = [struct.pack("<III", 0, 1_700_000_000, 5) + struct.pack(f"<I{len(parent)}sI1s", len(parent), parent, 1, child) + pose
         for parent, child in ((b"a", b"b"), (b"m", b"a"), (b"m", b"b"), (b"b", b"a"))]
for name, tree in (("chain", links[:1]), ("fork", links[1:3]), ("circle", [links[0], links[3]])):
    write("bag_messages", f"ros1_tf_{name}", bytes([254]) + struct.pack("<I", len(tree)) + b"".join(tree))
topics = connection(0, b"/imu", b"sensor_msgs/Imu") + connection(1, b"/scan", b"velodyne_msgs/VelodyneScan")
messages = b"".join(record(2, ros1[kind], conn=struct.pack("<I", number), time=struct.pack("<II", 1_700_000_001, 9))
                    for number, kind in ((0, 0), (0, 0), (1, 2)))
for name, compress in (("none", bytes), ("lz4", lz4), ("bz2", bz2.compress)):
    chunk = record(5, compress(topics + messages), compression=name.encode(), size=struct.pack("<I", len(topics + messages)))
    bag = b"#ROSBAG V2.0\n" + record(3, index_pos=bytes(8), conn_count=struct.pack("<I", 2), chunk_count=struct.pack("<I", 1))
    closed = bag.replace(b"index_pos=" + bytes(8), b"index_pos=" + struct.pack("<Q", len(bag + chunk)))
    write("bags", name, bag + chunk)
    write("bags", f"{name}_cut", bag + record(5, compress(topics + messages)[:-9], compression=name.encode(), size=struct.pack("<I", len(topics + messages))))
    write("bags", f"{name}_longer", bag + record(5, compress(topics + messages), compression=name.encode(), size=struct.pack("<I", 9999)))
    write("bags", f"{name}_shorter", bag + record(5, compress(topics + messages), compression=name.encode(), size=struct.pack("<I", 99)))
    write("bags", f"{name}_closed", closed + chunk + topics + record(6, struct.pack("<II", 0, 2), count=struct.pack("<I", 2)))
for name, part in (("no_time", record(2, ros1[0], conn=bytes(4))), ("no_connection", record(2, ros1[0], time=bytes(8))),
                   ("unknown_connection", record(2, ros1[0], conn=struct.pack("<I", 7), time=bytes(8))), ("other_record", record(9)),
                   ("no_size", record(5, topics, compression=b"none")), ("no_compression", record(5, topics, size=bytes(4))),
                   ("other_compression", record(5, topics, compression=b"zip", size=bytes(4))), ("bare_message", messages)):
    write("bags", name, bag + record(5, topics + part, compression=b"none", size=struct.pack("<I", len(topics + part))))
    write("bags", f"{name}_outside", bag + part)
write("bags", "no_head", b"#ROSBAG V2.0\n" + record(5, topics, compression=b"none", size=struct.pack("<I", len(topics))))
write("bags", "other_version", b"#ROSBAG V1.2\n")

# MCAP without the leading magic. Checksums are zero (unused), or mutations would stop there.
MCAP_MAGIC = b"\x89MCAP0\r\n"


def zstd(data):
    library = ctypes.CDLL("libzstd.so.1")
    library.ZSTD_compress.restype = ctypes.c_size_t
    out = ctypes.create_string_buffer(len(data) + 1000)
    return out.raw[:library.ZSTD_compress(out, ctypes.c_size_t(len(out)), data, ctypes.c_size_t(len(data)), 1)]


def mcap(op, content):
    return struct.pack("<BQ", op, len(content)) + content


def mcap_schema(number, name, encoding=b"ros2msg"):
    return mcap(3, struct.pack("<H", number) + text(name) + text(encoding) + text(b"float64 x"))


def mcap_channel(number, schema, topic, encoding=b"cdr"):
    return mcap(4, struct.pack("<HH", number, schema) + text(topic) + text(encoding) + text(text(b"a") + text(b"b")))


def mcap_message(channel, ns, data):
    return mcap(5, struct.pack("<HIQQ", channel, 0, ns, ns) + data)


def mcap_chunk(records, compression=b"", size=None, packed=None):
    packed = records if packed is None else packed
    return mcap(6, struct.pack("<QQQI", 0, 9, len(records) if size is None else size, 0) + text(compression) + struct.pack("<Q", len(packed)) + packed)


def mcap_end(before, summary=b""):
    end = mcap(15, bytes(4))
    return end + summary + mcap(2, struct.pack("<QQI", len(MCAP_MAGIC + before + end) if summary else 0, 0, 0)) + MCAP_MAGIC


mcap_head = mcap(1, text(b"ros2") + text(b"seeds"))
declared = mcap_schema(1, b"sensor_msgs/msg/Imu") + mcap_channel(1, 1, b"/imu") + mcap_channel(2, 0, b"/text", b"json")
declared += mcap_schema(3, b"velodyne_msgs/VelodyneScan", b"ros1msg") + mcap_channel(3, 3, b"/scan", b"ros1")
spoken = mcap_message(1, 1_700_000_000_000_000_000, b"imu") + mcap_message(3, 5, b"scan") + mcap_message(2, 7, b"{}")
figures = mcap(11, struct.pack("<QHIIIIQQ", 3, 2, 3, 0, 0, 1, 5, 7) + text(b""))
for name, chunk in (("bare", declared + spoken), ("plain", mcap_chunk(declared + spoken)),
                    ("lz4", mcap_chunk(declared + spoken, b"lz4", packed=lz4(declared + spoken))),
                    ("zstd", mcap_chunk(declared + spoken, b"zstd", packed=zstd(declared + spoken)))):
    body = mcap_head + chunk
    write("mcap", f"{name}_open", body)
    write("mcap", f"{name}_closed", body + mcap_end(body))
    write("mcap", f"{name}_summary", body + mcap_end(body, declared + figures))
    write("mcap", f"{name}_cut", body[:-9])
for name, part in (("longer", mcap_chunk(spoken, b"lz4", 9999, lz4(spoken))), ("shorter", mcap_chunk(spoken, b"zstd", 9, zstd(spoken))),
                   ("other", mcap_chunk(spoken, b"brotli")), ("nested", mcap_chunk(mcap_chunk(spoken))), ("absurd", mcap_chunk(spoken, b"zstd", 1 << 62)),
                   ("unknown_channel", mcap_message(9, 5, b"?")), ("late", mcap_message(1, (1 << 64) - 1, b"late")), ("zeros", bytes(40)),
                   ("again", mcap_channel(1, 3, b"/other", b"ros1") + spoken), ("attachment", mcap(9, bytes(50)) + spoken),
                   ("packed_message", mcap_message(1, 5, zstd(b"packed and packed and packed"))), ("packed_wrongly", mcap_message(1, 5, b"\x28\xb5\x2f\xfd\x60\xff\xff\xff"))):
    write("mcap", name, mcap_head + declared + part + mcap_end(b""))
write("mcap", "summary_too_far", mcap_head + declared + mcap(15, bytes(4)) + mcap(2, struct.pack("<QQI", 1 << 60, 0, 0)) + MCAP_MAGIC)

for name, packed in (("gzip", gzip.compress(b"packed and packed and packed")), ("xz", lzma.compress(b"packed and packed and packed")),
                     ("zstd", zstd(b"packed and packed and packed"))):
    for length in (0, 255):
        write("unpacking", f"{name}_{length}", bytes([length]) + packed)
    write("unpacking", f"{name}_twice", b"\x20" + packed + packed)
    write("unpacking", f"{name}_cut", b"\x20" + packed[:-5])
    write("unpacking", f"{name}_padded", b"\x20" + packed + bytes(9))
write("unpacking", "plain", b"\x03not packed")


# Clouds: fields (name, offset, type) of a point, its size, and a function of column, ring and time in s.
class Cdr:
    def __init__(self, aligned):
        self.out, self.aligned = b"", aligned

    def put(self, layout, *values):
        for letter, value in zip(layout, values):
            size = struct.calcsize("<" + letter)
            if self.aligned:
                self.out += bytes(-len(self.out) % size)
            self.out += struct.pack("<" + letter, value)

    def text(self, content):
        content += b"\0" if self.aligned else b""
        self.put("I", len(content))
        self.out += content


def cloud_message(aligned, index, fields, step, make_point, rows=1):
    columns, rings = 16, 16
    cdr = Cdr(aligned)
    if not aligned:
        cdr.put("I", index)
    cdr.put("II", 1_700_000_000, index * 100_000_000)
    cdr.text(b"lidar")
    points = b""
    for column in range(columns):
        for ring in range(rings):
            azimuth, elevation = 3.1 - 6.2 * column / columns, 0.03 * ring - 0.2
            xyz = 5 * math.cos(azimuth), 5 * math.sin(azimuth), 5 * math.tan(elevation)
            points += make_point(*xyz, ring, 0.1 * column / columns).ljust(step, b"\0")
    if fields is None:
        cdr.put("Q", 1_700_000_000_000_000_000)
        cdr.put("IBBBBI", columns * rings, 0, 0, 0, 0, columns * rings)
        return (bytes([0, 1, 0, 0]) if aligned else b"") + cdr.out + points
    cdr.put("II", rows, columns * rings // rows)
    cdr.put("I", len(fields))
    for name, offset, kind in fields:
        cdr.text(name)
        cdr.put("IBI", offset, kind, 1)
    cdr.put("BIII", 0, step, step * columns * rings // rows, len(points))
    cdr.out += points + b"\1"
    return (bytes([0, 1, 0, 0]) if aligned else b"") + cdr.out


XYZ = [(b"x", 0, 7), (b"y", 4, 7), (b"z", 8, 7), (b"intensity", 12, 7)]
EPOCH_S = 1_700_000_000
CLOUDS = {
    "velodyne": (XYZ + [(b"ring", 16, 4), (b"time", 18, 7)], 22, lambda x, y, z, r, t: struct.pack("<4fHf", x, y, z, 9, r, t - 0.1), 1),
    "ouster": (XYZ + [(b"t", 16, 6), (b"ring", 20, 2)], 24, lambda x, y, z, r, t: struct.pack("<4fIB", x, y, z, 9, int(t * 1e9), 15 - r), 16),
    "hesai": (XYZ + [(b"timestamp", 16, 8), (b"ring", 24, 4)], 26, lambda x, y, z, r, t: struct.pack("<4fdH", x, y, z, 9, EPOCH_S + t, r), 1),
    "livox": (XYZ + [(b"line", 16, 2), (b"timestamp", 18, 8)], 26, lambda x, y, z, r, t: struct.pack("<4fBBd", x, y, z, 9, r % 6, 0, EPOCH_S * 1e9 + t * 1e9), 1),
    "bare": (XYZ, 16, lambda x, y, z, r, t: struct.pack("<4f", x, y, z, 9), 1),
    "rows": (XYZ, 16, lambda x, y, z, r, t: struct.pack("<4f", x, y, z, 9), 8),
    "equal": (XYZ + [(b"time", 16, 7)], 20, lambda x, y, z, r, t: struct.pack("<5f", x, y, z, 9, 0), 1),
}
for name, (fields, step, make_point, rows) in CLOUDS.items():
    for aligned in (False, True):
        for times in range(3):
            stream = bytes([int(aligned) + 4 * times])
            for index in range(3):
                message = cloud_message(aligned, index, fields, step, make_point, rows)
                stream += struct.pack("<BH", 104 if index == 0 else 100, len(message)) + message
            write("cloud_messages", f"{name}_{'cdr' if aligned else 'ros1'}_{times}", stream)
for aligned in (False, True):
    message = cloud_message(aligned, 0, None, 20 if aligned else 19,
                            lambda x, y, z, r, t: struct.pack("<I3f3B", int(t * 1e9), x, y, z, 9, 16, r % 6))
    write("cloud_messages", f"custom_{int(aligned)}", bytes([2 + int(aligned), 104]) + struct.pack("<H", len(message)) + message)

# Tables of the times of sweeps: those of EuRoC and KITTI, and every unit.
for name, rows in {"euroc": "#timestamp [ns],filename\n1403636579763555584,1.pcd\n1403636579863555584,2.pcd\n",
                   "kitti": "0.000000e+00\n1.036224e-01\n2.072210e-01\n", "us": "1700000000000000\n1700000000100000\n",
                   "ms": "t x\n1700000000000 a.bin\r\n1700000000100 b.bin\n", "one": "5\n", "back": "2\n1\n", "none": "a\nb\n"}.items():
    write("sweep_times", name, rows)
