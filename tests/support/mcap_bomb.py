"""An MCAP file whose only chunk is small and unpacks to 256 MiB."""

from pathlib import Path
from typing import Any

import zstandard
from lz4.frame import LZ4FrameCompressor
from mcap.data_stream import RecordBuilder
from mcap.records import Chunk, Header


def write_mcap_bomb(path: Path, compression: str, stated: int) -> Path:
    """compression: lz4 or zstd; stated: the length that the chunk says that it has, bytes."""
    packer: Any = LZ4FrameCompressor() if compression == "lz4" else zstandard.ZstdCompressor().compressobj()
    parts = [packer.begin()] if compression == "lz4" else []
    parts += [packer.compress(bytes(1 << 20)) for _ in range(256)]
    builder = RecordBuilder()
    Header("", "").write(builder)
    Chunk(compression, b"".join([*parts, packer.flush()]), 0, 0, 0, stated).write(builder)
    path.write_bytes(b"\x89MCAP0\r\n" + builder.end())
    return path
