# SPDX-License-Identifier: Apache-2.0
"""mcap_output_test.py LOCUS_REPLAY CAPTURE: the file of --mcap is as the specification of MCAP says (mcap.dev/spec).

The reader is independent of that of the project: it follows summary, indices and offsets as players do, verifies each
checksum, and decodes every message (CDR) by the definition in the file alone.
"""
import ctypes
import struct
import subprocess
import sys
import tempfile
import unittest
import zlib
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

PROGRAM, CAPTURE = Path(sys.argv[1]), Path(sys.argv[2])
MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
STATISTICS, SUMMARY_OFFSET, DATA_END = 11, 14, 15
ZSTD = ctypes.CDLL("libzstd.so.1")
ZSTD.ZSTD_decompress.restype = ctypes.c_size_t


class Fields:
    """Reads the fields of a record, one after another."""

    def __init__(self, data: bytes) -> None:
        self.data, self.at = data, 0

    def number(self, form: str) -> int:
        (value,) = struct.unpack_from("<" + form, self.data, self.at)
        self.at += struct.calcsize("<" + form)
        return int(value)

    def bytes(self, length_form: str = "I") -> bytes:
        size = self.number(length_form)
        self.at += size
        assert self.at <= len(self.data)
        return self.data[self.at - size : self.at]

    def text(self) -> str:
        return self.bytes().decode()

    def pairs(self, key: Callable[["Fields"], Any], value: Callable[["Fields"], Any]) -> list[tuple[Any, Any]]:
        inner = Fields(self.bytes())
        result = []
        while inner.at < len(inner.data):
            result.append((key(inner), value(inner)))
        return result

    def is_over(self) -> bool:
        return self.at == len(self.data)


def u16(fields: Fields) -> int:
    return fields.number("H")


def u64(fields: Fields) -> int:
    return fields.number("Q")


@dataclass
class Record:
    op: int
    begin: int
    """Offset of the record in its file or chunk."""
    end: int
    content: bytes

    def fields(self) -> Fields:
        return Fields(self.content)


def record_at(data: bytes, at: int) -> Record:
    op, length = struct.unpack_from("<BQ", data, at)
    assert at + 9 + length <= len(data)
    return Record(op, at, at + 9 + length, data[at + 9 : at + 9 + length])


def records(data: bytes, begin: int, end: int) -> Iterator[Record]:
    while begin < end:
        record = record_at(data, begin)
        yield record
        begin = record.end
    assert begin == end


def unpack_chunk(chunk: Record) -> tuple[int, int, bytes]:
    """Returns the times of the first and the last message, and the records; verifies size and checksum."""
    fields = chunk.fields()
    first, last, size, crc, compression = u64(fields), u64(fields), u64(fields), fields.number("I"), fields.text()
    packed = fields.bytes("Q")
    assert fields.is_over() and compression == "zstd"
    room = ctypes.create_string_buffer(size)
    assert ZSTD.ZSTD_decompress(room, ctypes.c_size_t(size), packed, ctypes.c_size_t(len(packed))) == size
    assert zlib.crc32(room.raw) == crc
    return first, last, room.raw


class Definition:
    """Decodes CDR by the text of a message definition of ROS 2."""

    NUMBERS = {"bool": "?", "byte": "B", "char": "B", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H",
               "int32": "i", "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f", "float64": "d"}

    def __init__(self, text: str) -> None:
        main, *others = text.split("=" * 80 + "\n")
        self.fields = self.fields_of(main)
        self.types = {}
        for other in others:
            name, _, fields = other.partition("\n")
            assert name.startswith("MSG: ")
            self.types[name[5:]] = self.fields_of(fields)

    @staticmethod
    def fields_of(text: str) -> list[list[str]]:
        lines = (line.partition("#")[0].split() for line in text.splitlines())
        return [line[:2] for line in lines if line and "=" not in line[1]]  # without constants and defaults

    def decode(self, data: bytes) -> dict[str, Any]:
        assert data[:4] == b"\x00\x01\x00\x00"  # little-endian CDR
        reader = Fields(data[4:])
        message = self.struct(self.fields, reader)
        assert reader.is_over(), f"{len(reader.data) - reader.at} bytes are left"
        return message

    def struct(self, fields: list[list[str]], reader: Fields) -> dict[str, Any]:
        return {name: self.value(kind, reader) for kind, name in fields}

    def value(self, kind: str, reader: Fields) -> Any:
        if kind.endswith("]"):
            kind, _, count = kind[:-1].partition("[")
            length = int(count) if count else self.value("uint32", reader)
            if kind == "uint8":
                reader.at += length
                assert reader.at <= len(reader.data)
                return reader.data[reader.at - length : reader.at]
            return [self.value(kind, reader) for _ in range(length)]
        if kind == "string":
            length = self.value("uint32", reader)
            reader.at += length
            assert reader.data[reader.at - 1] == 0
            return reader.data[reader.at - length : reader.at - 1].decode()
        if form := self.NUMBERS.get(kind):
            size = struct.calcsize(form)
            reader.at += -reader.at % size
            (number,) = struct.unpack_from("<" + form, reader.data, reader.at)
            reader.at += size
            return number
        return self.struct(self.types[kind], reader)


class McapOutput(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "out.mcap"
            subprocess.run([PROGRAM, "--quiet", "--mcap", file, "-o", Path(folder) / "out", CAPTURE], check=True)
            cls.data = file.read_bytes()
            lines = (Path(folder) / "out" / "odometry.tum").read_text().splitlines()
            cls.trajectory = [[float(word) for word in line.split()] for line in lines]
        cls.footer = record_at(cls.data, len(cls.data) - 8 - 29)
        footer = cls.footer.fields()
        cls.summary_start, cls.offsets_start, cls.summary_crc = u64(footer), u64(footer), footer.number("I")
        cls.summary: dict[int, list[Record]] = defaultdict(list)
        for record in records(cls.data, cls.summary_start, cls.offsets_start):
            cls.summary[record.op].append(record)

    def chunks(self) -> Iterator[tuple[Fields, Record]]:
        """Yields the indices of the summary, their first two times read, and the chunks that they locate."""
        for index in self.summary[CHUNK_INDEX]:
            fields = index.fields()
            fields.at = 16
            chunk = record_at(self.data, u64(fields))
            self.assertEqual(chunk.op, CHUNK)
            self.assertEqual(u64(fields), chunk.end - chunk.begin)
            yield fields, chunk

    def test_order_of_the_records(self) -> None:
        self.assertTrue(self.data.startswith(MAGIC) and self.data.endswith(MAGIC))
        ops = [record.op for record in records(self.data, 8, self.summary_start)]
        self.assertEqual((ops[0], ops[-1]), (HEADER, DATA_END))
        self.assertLessEqual(set(ops[1:-1]), {CHUNK, MESSAGE_INDEX})
        self.assertEqual(ops[1], CHUNK)
        header = record_at(self.data, 8).fields()
        self.assertEqual((header.text(), header.text(), header.is_over()), ("ros2", "locusd", True))
        self.assertEqual(self.footer.op, FOOTER)

    def test_summary(self) -> None:
        checked = self.data[self.summary_start : self.footer.begin + 9 + 16]
        self.assertEqual(zlib.crc32(checked), self.summary_crc)
        at = self.summary_start
        for record in records(self.data, self.offsets_start, self.footer.begin):
            self.assertEqual(record.op, SUMMARY_OFFSET)
            fields = record.fields()
            op, begin, length = fields.number("B"), u64(fields), u64(fields)
            self.assertEqual(begin, at)
            self.assertEqual({one.op for one in records(self.data, begin, begin + length)}, {op})
            at += length
        self.assertEqual(at, self.offsets_start)

    def test_statistics_are_those_of_the_messages(self) -> None:
        counts: Counter[int] = Counter()
        times = []
        for _, chunk in self.chunks():
            first, last, content = unpack_chunk(chunk)
            times += [first, last]
            for record in records(content, 0, len(content)):
                if record.op == MESSAGE:
                    counts[u16(record.fields())] += 1
        (statistics,) = self.summary[STATISTICS]
        fields = statistics.fields()
        self.assertEqual(u64(fields), counts.total())
        self.assertEqual((u16(fields), fields.number("I")), (len(self.summary[SCHEMA]), len(self.summary[CHANNEL])))
        self.assertEqual((fields.number("I"), fields.number("I")), (0, 0))  # attachments, metadata
        self.assertEqual(fields.number("I"), len(self.summary[CHUNK_INDEX]))
        self.assertEqual((u64(fields), u64(fields)), (min(times), max(times)))
        self.assertEqual(dict(fields.pairs(u16, u64)), counts)
        self.assertTrue(fields.is_over())
        in_file = sum(record.op == CHUNK for record in records(self.data, 8, self.summary_start))
        self.assertEqual(in_file, len(self.summary[CHUNK_INDEX]))

    def test_indices_locate_every_message(self) -> None:
        for fields, chunk in self.chunks():
            first, last, content = unpack_chunk(chunk)
            by_place: dict[int, tuple[int, int]] = {}
            length = 0
            for channel, begin in fields.pairs(u16, u64):
                index = record_at(self.data, begin)
                length += index.end - index.begin
                entries = index.fields()
                self.assertEqual((index.op, u16(entries)), (MESSAGE_INDEX, channel))
                by_place |= {place: (channel, time) for time, place in entries.pairs(u64, u64)}
                self.assertTrue(entries.is_over())
            self.assertEqual(u64(fields), length)
            self.assertEqual((fields.text(), u64(fields)), ("zstd", len(chunk.content) - 44))
            self.assertEqual((u64(fields), fields.is_over()), (len(content), True))
            messages = {}
            for record in records(content, 0, len(content)):
                if record.op == MESSAGE:
                    message = record.fields()
                    channel, _, time = u16(message), message.number("I"), u64(message)
                    messages[record.begin] = (channel, time)
            self.assertEqual(by_place, messages)
            self.assertEqual((first, last), (min(t for _, t in messages.values()), max(t for _, t in messages.values())))

    def test_messages_are_as_their_definitions_say(self) -> None:
        """Decodes front to back; what a message needs precedes it, so that a truncated file is readable."""
        schemas: dict[int, Definition] = {}
        channels: dict[int, tuple[int, str]] = {}
        next_sequence: Counter[int] = Counter()
        decoded: dict[str, list[dict[str, Any]]] = defaultdict(list)
        for _, chunk in self.chunks():
            content = unpack_chunk(chunk)[2]
            for record in records(content, 0, len(content)):
                fields = record.fields()
                if record.op == SCHEMA:
                    number, name, encoding, text = u16(fields), fields.text(), fields.text(), fields.text()
                    self.assertEqual((encoding, name.split("/")[1], fields.is_over()), ("ros2msg", "msg", True))
                    schemas[number] = Definition(text)
                elif record.op == CHANNEL:
                    number, schema, topic, encoding = u16(fields), u16(fields), fields.text(), fields.text()
                    metadata = dict(fields.pairs(Fields.text, Fields.text))
                    self.assertEqual(encoding, "cdr")
                    self.assertIn("offered_qos_profiles", metadata)
                    self.assertTrue(fields.is_over())
                    channels[number] = (schema, topic)
                else:
                    self.assertEqual(record.op, MESSAGE)
                    channel, sequence, _, _ = u16(fields), fields.number("I"), u64(fields), u64(fields)
                    self.assertEqual(sequence, next_sequence[channel])
                    next_sequence[channel] += 1
                    schema, topic = channels[channel]
                    decoded[topic].append(schemas[schema].decode(fields.data[fields.at :]))
        self.expect_results(decoded)

    def expect_results(self, decoded: dict[str, list[dict[str, Any]]]) -> None:
        self.assertGreater(len(self.trajectory), 70)
        self.assertEqual(len(decoded["/locus/odometry"]), len(self.trajectory))
        for message, row in zip(decoded["/locus/odometry"], self.trajectory):
            stamp, pose = message["header"]["stamp"], message["pose"]["pose"]
            self.assertAlmostEqual(stamp["sec"] + stamp["nanosec"] * 1e-9, row[0], delta=1e-5)
            position, orientation = pose["position"], pose["orientation"]
            for value, expected in zip([*position.values(), *orientation.values()], row[1:], strict=True):
                self.assertAlmostEqual(value, expected, delta=1e-6)
            self.assertEqual((message["header"]["frame_id"], message["child_frame_id"]), ("odom", "base_link"))
        for cloud in decoded["/locus/cloud"]:
            self.assertEqual(len(cloud["data"]), cloud["row_step"] * cloud["height"])
            self.assertEqual(cloud["row_step"], cloud["point_step"] * cloud["width"])
            self.assertLessEqual({"x", "y", "z", "intensity"}, {field["name"] for field in cloud["fields"]})
        children = {t["child_frame_id"] for message in decoded["/tf_static"] for t in message["transforms"]}
        self.assertEqual(children, {"front", "imu"})
        self.assertGreater(len(decoded["/imu/data"]), 600)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
