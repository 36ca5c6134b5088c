"""Malicious and randomly damaged recordings: faults are counted, memory is bounded, no traceback."""

import random
import struct
import zlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zstandard
from lz4.frame import LZ4FrameCompressor
from mcap.data_stream import RecordBuilder
from mcap.records import Chunk, DataEnd, Footer, Header, Metadata, MetadataIndex
from mcap.writer import CompressionType, Writer

from edge.errors import SourceError
from edge.recording.mcap_file import read_metadata
from edge.recording.reader import RecordingSource
from edge.recording.topics import proto
from edge.recording.writer import Recorder
from edge.types import Frame
from hostlink.mcap_chunk import UNPACKED_MAX
from tests.edge.sources.test_image_header import png_of
from tests.support.damage import damaged
from tests.support.memory import bounded_memory
from tests.support.messages import read_messages
from tests.support.seeds import SEED

MEMORY_MAX = 48 << 20  # in addition to that used before; the files are below 1 MiB


def good_image(value: int = 9) -> Any:
    return proto("RawImage")(width=8, height=6, encoding="mono8", step=8, data=bytes([value]) * 48)


def write(path: Path, *messages: tuple[str, Any]) -> Path:
    """A file of another tool: (topic, protobuf image or JSON text), 1 ms apart, a chunk each."""
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=1, compression=CompressionType.NONE)
        writer.start()
        channels: dict[tuple[str, str], int] = {}
        for n, (topic, message) in enumerate(messages):
            text = isinstance(message, str)
            name = "voronoi_touch.Frame" if text else message.DESCRIPTOR.full_name
            if (topic, name) not in channels:
                encoding = "json" if text else "protobuf"
                schema = writer.register_schema(name, "jsonschema" if text else "protobuf", b"{}")
                channels[topic, name] = writer.register_channel(topic, encoding, schema)
            data = message.encode() if text else message.SerializeToString()
            ns = n // 2 * 1_000_000 + 1  # data before an image belong to it
            writer.add_message(channels[topic, name], ns, data, ns, n)
        writer.finish()
    return path


def read_everything(path: Path) -> int:
    """Run all readers on a file; returns the images. SourceError is the only exception allowed."""
    images_n = 0
    for read in (read_metadata, lambda p: list(read_messages(p))):
        with suppress(SourceError):
            read(path)
    with suppress(SourceError):
        source = RecordingSource(path)
        for frame in source:
            assert frame.image.shape == source.size_px[::-1]
            assert 1 <= frame.bits <= 8 * frame.image.dtype.itemsize
            images_n += 1
        assert source.frames_n >= 0
    return images_n


@pytest.mark.parametrize(
    "about",
    [
        '"bits": 0',
        '"bits": -1',
        '"bits": 10000000000',
        '"bits": 12',  # of a pixel that has 8
        '"bits": null, "sequence": 1e400',
        '"sequence": -1',
        '"capture_ns": 99999999999999999999999',
        '"clock": "sundial"',
        '"x": ' + "[" * 5000,
    ],
)
def test_impossible_frames_are_counted_and_skipped(tmp_path: Path, about: str) -> None:
    parts = '"sequence": 7', '"capture_ns": 1000', '"clock": "host"', '"bits": 8'
    kept = [part for part in parts if part.partition(":")[0] != about.partition(":")[0]]
    messages: list[tuple[str, Any]] = []
    for frame in (parts, (about, *kept)):
        messages += [("/camera/frame", f"{{{', '.join(frame)}}}"), ("/camera/image", good_image())]
    path = write(tmp_path / "a.mcap", *messages)
    with bounded_memory(MEMORY_MAX):
        source = RecordingSource(path)
        frames = list(source)
    assert frames[0].sequence == 7
    assert source.faults["damaged message"] == 1
    assert all(frame.bits == 8 for frame in frames)


@pytest.mark.parametrize(
    ("side_px", "fault"),
    [(32_000, "damaged message"), (4000, "other image size")],  # the second one a camera may have
)
def test_an_enormous_picture_and_one_of_another_size_are_not_decoded(
    tmp_path: Path, side_px: int, fault: str
) -> None:
    large = proto("CompressedImage")(format="png", data=png_of(side_px, side_px))
    path = write(tmp_path / "a.mcap", ("/camera/image", good_image()), ("/camera/image", large))
    with bounded_memory(MEMORY_MAX):
        source = RecordingSource(path)
        assert len(list(source)) == 1
    assert source.faults[fault] == 1
    if fault == "damaged message":
        alone = write(tmp_path / "b.mcap", ("/camera/image", large))
        with bounded_memory(MEMORY_MAX), pytest.raises(SourceError, match="no complete image"):
            RecordingSource(alone)


def chunk_at(data: bytes) -> int:
    """Begin of the first chunk record."""
    at = 8
    while data[at] != 6:
        at += 9 + struct.unpack_from("<Q", data, at + 1)[0]
    return at


def write_mcap_bomb(path: Path, compression: str, stated: int) -> Path:
    """A file whose only chunk is small, says that it has `stated` bytes, and unpacks to 256 MiB."""
    packer: Any = LZ4FrameCompressor() if compression == "lz4" else zstandard.ZstdCompressor().compressobj()
    parts = [packer.begin()] if compression == "lz4" else []
    parts += [packer.compress(bytes(1 << 20)) for _ in range(256)]
    builder = RecordBuilder()
    Header("", "").write(builder)
    Chunk(compression, b"".join([*parts, packer.flush()]), 0, 0, 0, stated).write(builder)
    path.write_bytes(b"\x89MCAP0\r\n" + builder.end())
    return path


@pytest.mark.parametrize("compression", ["lz4", "zstd"])
@pytest.mark.parametrize("stated", [1000, 100 << 20, 1 << 40])
def test_a_chunk_that_unpacks_endlessly_is_damaged(tmp_path: Path, compression: str, stated: int) -> None:
    path = write_mcap_bomb(tmp_path / "a.mcap", compression, stated)
    doubled = 2 * (stated if stated < UNPACKED_MAX else 0)  # lz4 doubles as it grows
    with bounded_memory(MEMORY_MAX + doubled), pytest.raises(SourceError, match=r"cut off before"):
        RecordingSource(path)


@pytest.mark.parametrize("offset", [0, 3, 1 << 20, 1 << 40, (1 << 63) + 5, (1 << 64) - 1])
def test_a_wrong_chunk_index_loses_that_chunk_only(tmp_path: Path, offset: int) -> None:
    path = write(tmp_path / "a.mcap", *[("/camera/image", good_image(n)) for n in range(4)])
    data = bytearray(path.read_bytes())
    at = data.rindex(struct.pack("<Q", chunk_at(bytes(data))))  # in the chunk's index
    data[at : at + 8] = struct.pack("<Q", offset)
    path.write_bytes(data)
    source = RecordingSource(path)
    assert len(list(source)) == 3
    assert source.faults["damaged chunk"] == 1


def test_metadata_that_are_listed_often_are_read_once(tmp_path: Path) -> None:
    head, body, tail = RecordBuilder(), RecordBuilder(), RecordBuilder()
    Header("", "").write(head)
    before = b"\x89MCAP0\r\n" + head.end()
    Metadata("big", {"key": "x" * (1 << 20)}).write(body)
    stored = body.end()
    DataEnd(0).write(tail)
    start = len(before) + len(stored) + tail.count
    for _ in range(200):
        MetadataIndex(offset=len(before), length=len(stored), name="big").write(tail)
    Footer(summary_start=start, summary_offset_start=0, summary_crc=0).write(tail)
    path = tmp_path / "a.mcap"
    path.write_bytes(before + stored + tail.end() + b"\x89MCAP0\r\n")
    with bounded_memory(MEMORY_MAX):
        assert {name: len(data["key"]) for name, data in read_metadata(path).items()} == {"big": 1 << 20}


def seeds(folder: Path) -> list[bytes]:
    """Small recordings of every kind."""
    rng = np.random.default_rng(1)
    made = []
    for n, options in enumerate(
        [{}, {"image": "png"}, {"compression": "lz4"}, {"compression": "zstd", "image": "png"}]
    ):
        path = folder / f"seed{n}.mcap"
        with Recorder(path, tip={"serial": "T-1"}, offset_ns=0, **options) as recorder:  # type: ignore[arg-type]
            recorder.attach("calibration.json", b"{}")
            for k in range(3):
                image = rng.integers(0, 255, (12, 16), dtype=np.uint8)
                recorder.frame(Frame(image, 1000 * k, k, truth={"depth_mm": 0.5}))
            recorder.event("warning", "words")
        made.append(path.read_bytes())
    return made


def crc_repaired(data: bytes) -> bytes:
    """Correct the chunks' checksums, so that changes pass the first check."""
    changed = bytearray(data)
    at = 8
    while at + 9 <= len(changed):
        length = struct.unpack_from("<Q", changed, at + 1)[0]
        if changed[at] == 6 and at + 9 + length <= len(changed) and length >= 40:
            name_n = struct.unpack_from("<I", changed, at + 37)[0]
            begin = at + 41 + name_n + 8
            if name_n == 0 and begin <= at + 9 + length:
                changed[at + 33 : at + 37] = struct.pack("<I", zlib.crc32(changed[begin : at + 9 + length]))
        at += 9 + length
    return bytes(changed)


@pytest.mark.generative
@pytest.mark.parametrize("repair", [bytes, crc_repaired], ids=["as changed", "checksums put right"])
def test_random_files_are_read_or_refused(tmp_path: Path, repair: Callable[[bytes], bytes]) -> None:
    """Randomly changed files: no exception but SourceError, little memory."""
    dice = random.Random(15 + SEED)
    good = seeds(tmp_path)
    path = tmp_path / "changed.mcap"
    images_n = 0
    with bounded_memory(MEMORY_MAX):
        for _ in range(400):
            path.write_bytes(repair(damaged(dice, dice.choice(good))))
            images_n += read_everything(path)
    assert images_n > 100, "most changes leave something to read"
