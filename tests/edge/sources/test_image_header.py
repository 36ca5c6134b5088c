"""Sizes from headers: the same as decoded, and never a large image for a few bytes."""

import random
import struct
import zlib
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np
import pytest

from edge.errors import SourceError
from edge.sources import open_source
from edge.sources.image_header import check_size, image_size

FORMATS = (".png", ".jpg", ".bmp", ".tif", ".pgm", ".webp")


def png_of(width: int, height: int) -> bytes:
    """A PNG with this size in its header, and no pixels."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 16, 6, 0, 0, 0)
    pixels = chunk(b"IDAT", zlib.compress(bytes(1 << 20)))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + pixels + chunk(b"IEND", b"")


@pytest.mark.parametrize("shape", [(48, 64), (1, 300), (301, 7)], ids=str)
@pytest.mark.parametrize("suffix", FORMATS)
def test_the_size_is_that_of_the_decoded_image(suffix: str, shape: tuple[int, int]) -> None:
    for image in (np.full(shape, 7, np.uint8), np.full((*shape, 3), 7, np.uint8)):
        if suffix == ".pgm" and image.ndim == 3:
            continue
        ok, data = cv2.imencode(suffix, image)
        assert ok
        assert image_size(data.tobytes()) == shape[::-1]


def test_other_kinds_of_the_same_formats() -> None:
    lossless = cv2.imencode(".webp", np.zeros((20, 30, 3), np.uint8), (cv2.IMWRITE_WEBP_QUALITY, 101))[1]
    deep = [cv2.imencode(suffix, np.zeros((20, 30), np.uint16))[1] for suffix in (".png", ".tif", ".pgm")]
    comment = b"P5\n# made by hand\n 30 \n20\n255\n" + bytes(600)
    for data in (lossless.tobytes(), *(one.tobytes() for one in deep), comment):
        assert image_size(data) == (30, 20)


@pytest.mark.parametrize(
    ("width", "height"), [(32_000, 32_000), (8193, 1), (8192, 2561), (0, 5), (1 << 31, 1 << 31)]
)
def test_too_many_pixels_are_refused_before_they_are_decoded(tmp_path: Path, width: int, height: int) -> None:
    path = tmp_path / "large.png"
    path.write_bytes(png_of(width, height))
    with pytest.raises(SourceError, match=r"large\.png: .* pixels"):
        open_source(str(path))


def test_modified_headers_give_a_size_or_a_value_error() -> None:
    dice = random.Random(10)
    image = np.zeros((40, 50, 3), np.uint8)
    files = [cv2.imencode(suffix, image)[1].tobytes() for suffix in (*FORMATS[:4], ".ppm", ".webp")]
    for _ in range(5000):
        data = bytearray(dice.choice(files)[: dice.choice([8, 20, 40, 1000])])
        for _ in range(dice.randrange(1, 5)):
            data[dice.randrange(len(data))] = dice.randrange(256)
        with suppress(ValueError):
            width, height = image_size(bytes(data))
            check_size(width, height)
            assert 1 <= width * height <= 1 << 24
