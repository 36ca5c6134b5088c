"""Unpacks a chunk of an MCAP file that may be damaged or malicious; memory is bounded first."""

from __future__ import annotations

from typing import Any, Final

__all__ = ["UNPACKED_MAX", "unpack_chunk"]

#: Bytes of one record or of one unpacked chunk. Ours stay near 1 MiB; the largest image has 32 MiB.
UNPACKED_MAX: Final = 128 << 20


def unpack_chunk(chunk: Any) -> Any:
    """The same chunk without compression, its CRC checked.

    Raises  ValueError: too large, its real size is not the stated one, or its compression is not known;
            errors of the mcap library and of the decompressors
    """
    from mcap.records import Chunk
    from mcap.stream_reader import get_chunk_data_stream

    if chunk.uncompressed_size > UNPACKED_MAX:
        raise ValueError(f"a chunk of {chunk.uncompressed_size} bytes")
    plain = Chunk(
        compression="",
        data=_decompressed(chunk),
        message_end_time=0,
        message_start_time=0,
        uncompressed_crc=chunk.uncompressed_crc,
        uncompressed_size=chunk.uncompressed_size,
    )
    get_chunk_data_stream(plain, validate_crc=True)
    return plain


def _decompressed(chunk: Any) -> bytes:
    """Raises ValueError: its real size is not the stated one."""
    size = chunk.uncompressed_size
    if chunk.compression == "lz4":
        from lz4.frame import LZ4FrameDecompressor

        data: bytes = LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
    elif chunk.compression == "zstd":
        from zstandard import ZstdDecompressor

        with ZstdDecompressor().stream_reader(chunk.data) as reader:
            data = reader.read(size + 1)
    elif chunk.compression:
        raise ValueError(f"compression {chunk.compression!r} is not known")
    else:
        data = chunk.data
    if len(data) != size:
        raise ValueError(f"a chunk of {size} bytes holds others")
    return data
