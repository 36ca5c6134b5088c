"""Reads the header of a file: width and height of an image, and whether a video was cut off.

Size comes before memory is allocated for the pixels: a 15 MB PNG may stand for 32000 x 32000 of 8 bytes.
Sources: PNG (RFC 2083), JPEG (ITU T.81, B.2.2), BMP (BITMAPINFOHEADER), Netpbm, TIFF 6.0, WebP (RFC 9649);
AVI (RIFF), Matroska (RFC 8794).
"""

import re
import struct
from collections.abc import Callable
from pathlib import Path
from zlib import crc32

from edge.limits import IMAGE_PIXELS, IMAGE_SIDE_PX

_SOF = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}  # JPEG: start of frame, of all kinds
_STANDALONE = frozenset({0x01, *range(0xD0, 0xD9)})  # JPEG: markers without a length
_PNM = re.compile(rb"P[1-6](?:\s|#[^\n]*\n)+(\d{1,9})(?:\s|#[^\n]*\n)+(\d{1,9})\s")


def image_size(data: bytes | memoryview) -> tuple[int, int]:
    """(width, height), px. Raises ValueError: none of the formats, or its header is damaged."""
    data = memoryview(data)
    head = bytes(data[:16])
    for start, read in _FORMATS.items():
        if head.startswith(start):
            try:
                return read(data)
            except (struct.error, IndexError):
                raise ValueError("its header is damaged") from None
    raise ValueError("not an image")


def check_size(width: int, height: int) -> None:
    """Raises ValueError: no pixels, or more than any camera's."""
    if width < 1 or height < 1:
        raise ValueError(f"{width}x{height} pixels are no image")
    if max(width, height) > IMAGE_SIDE_PX or width * height > IMAGE_PIXELS:
        raise ValueError(
            f"{width}x{height} pixels are too many; at most {IMAGE_SIDE_PX} a side and {IMAGE_PIXELS} in all"
        )


def is_whole_png(data: memoryview) -> bool:
    """Whether a PNG is complete and unharmed: of one that is not, libpng itself would tell the user."""
    at, kind = 8, b""
    while kind != b"IEND" and at + 12 <= len(data):
        size, kind = struct.unpack_from(">I4s", data, at)
        at += 12 + size
        if kind[0] < ord("a") and data[at - 4 : at] != crc32(data[at - size - 8 : at - 4]).to_bytes(4):
            return False  # a chunk with a small letter is not needed
    return kind == b"IEND"


def _png(data: memoryview) -> tuple[int, int]:
    if bytes(data[12:16]) != b"IHDR":
        raise IndexError
    width, height = struct.unpack_from(">II", data, 16)
    return width, height


def _jpeg(data: memoryview) -> tuple[int, int]:
    at = 2
    while True:
        if data[at] != 0xFF:
            raise IndexError
        marker = data[at + 1]
        if marker == 0xFF:  # padding
            at += 1
        elif marker in _STANDALONE:
            at += 2
        elif marker in _SOF:
            height, width = struct.unpack_from(">HH", data, at + 5)
            return width, height
        else:
            (length,) = struct.unpack_from(">H", data, at + 2)
            at += 2 + max(2, length)


def _bmp(data: memoryview) -> tuple[int, int]:
    (header_bytes,) = struct.unpack_from("<I", data, 14)
    width, height = struct.unpack_from("<HH" if header_bytes == 12 else "<ii", data, 18)
    return width, abs(height)  # a negative height: rows from the top


def _pnm(data: memoryview) -> tuple[int, int]:
    found = _PNM.match(bytes(data[:4096]))
    if found is None:
        raise IndexError
    return int(found[1]), int(found[2])


def _tiff(data: memoryview) -> tuple[int, int]:
    order = "<" if data[0] == ord("I") else ">"
    (at,) = struct.unpack_from(order + "I", data, 4)
    (entries_n,) = struct.unpack_from(order + "H", data, at)
    found: dict[int, int] = {}
    for entry in range(entries_n):
        tag, kind = struct.unpack_from(order + "HH", data, at + 2 + 12 * entry)
        if tag in (256, 257):  # ImageWidth, ImageLength; SHORT or LONG
            code = order + ("H" if kind == 3 else "I")
            (found[tag],) = struct.unpack_from(code, data, at + 10 + 12 * entry)
    if len(found) != 2:
        raise IndexError
    return found[256], found[257]


def _webp(data: memoryview) -> tuple[int, int]:
    if bytes(data[8:12]) != b"WEBP":
        raise IndexError
    kind = bytes(data[12:16])
    if kind == b"VP8 ":
        width, height = struct.unpack_from("<HH", data, 26)
        return width & 0x3FFF, height & 0x3FFF
    if kind == b"VP8L":
        (bits,) = struct.unpack_from("<I", data, 21)
        return (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
    if kind == b"VP8X":
        return int.from_bytes(data[24:27], "little") + 1, int.from_bytes(data[27:30], "little") + 1
    raise IndexError


#: First bytes of each format, and the function that reads its header.
_FORMATS: dict[bytes, Callable[[memoryview], tuple[int, int]]] = {
    b"\x89PNG\r\n\x1a\n": _png,
    b"\xff\xd8": _jpeg,
    b"BM": _bmp,
    **{b"P%d" % n: _pnm for n in range(1, 7)},
    b"II*\0": _tiff,
    b"MM\0*": _tiff,
    b"RIFF": _webp,
}


def is_cut_off(path: Path) -> bool:
    """Whether an AVI or Matroska file ends before its container does: stated images may be an estimate."""
    with path.open("rb") as file:
        head = file.read(256)
    if head.startswith(b"RIFF"):
        end = 8 + int.from_bytes(head[4:8], "little")
    else:
        # Matroska's segment; in the length, leading zeros say how long it is.
        at = head.find(b"\x18\x53\x80\x67") + 4
        bits = 7 * (9 - head[at].bit_length())
        length = int.from_bytes(head[at : at + bits // 7], "big") & (1 << bits) - 1
        known = at > 3 and length != (1 << bits) - 1
        end = at + bits // 7 + length if known else 0
    return end > path.stat().st_size
