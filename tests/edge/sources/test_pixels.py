"""The same picture gives the same pixels from every source, whatever it is stored as."""

from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import PIL.Image
import pytest
from mcap.writer import Writer

from edge.recording.topics import proto
from edge.sources import open_source
from edge.sources.files import FileSource
from edge.sources.pixels import LAYOUTS, unpack
from edge.types import Frame, Image
from tests.edge.sources.test_sources import video_of
from tests.edge.sources.test_v4l2 import FakeCamera, Opened

W, H = 64, 48


def picture(bits: int = 8) -> Image:
    """Smooth, so that a Bayer filter's interpolation changes it little, and of the whole range."""
    y, x = np.mgrid[0:H, 0:W]
    grey = (1 + np.sin(x / 9) * np.cos(y / 7)) / 2 * ((1 << bits) - 1)
    rounded: Image = np.rint(grey).astype(np.uint8 if bits == 8 else np.uint16)
    return rounded


def packed(image: Image, bits: int) -> bytes:
    """MIPI's packing: the upper bytes of some pixels, then their lower bits in one."""
    n = 8 // (bits - 8)
    rows = bytearray()
    for unit in image.reshape(-1, n).tolist():
        rows += bytes(value >> bits - 8 for value in unit)
        rows.append(sum((value & (1 << bits - 8) - 1) << k * (bits - 8) for k, value in enumerate(unit)))
    return bytes(rows)


def interleaved(image: Image, *places: int | None) -> bytes:
    """The image in some places of each pixel's values, 77 in the others."""
    values = [image if place is not None else np.full_like(image, 77) for place in places]
    return np.stack(values, axis=2).tobytes()


GREY = picture()
CHROMA = bytes([77]) * (W * H // 2)
#: By a layout's names: its bits, the picture in it, the most that interpolation may change.
STORED: dict[str, tuple[int, bytes, int]] = {
    "mono8 8UC1 GREY": (8, GREY.tobytes(), 0),
    "mono16 16UC1 Y16": (16, picture(16).tobytes(), 0),
    "Y10": (10, picture(10).tobytes(), 0),
    "Y12": (12, picture(12).tobytes(), 0),
    "Y10P": (10, packed(picture(10), 10), 0),
    "Y12P": (12, packed(picture(12), 12), 0),
    "yuyv yuv422_yuy2 YUYV": (8, interleaved(GREY, 0, None), 0),
    "uyvy yuv422 UYVY": (8, interleaved(GREY, None, 0), 0),
    "nv12 nv21 NV12 NV21 YU12 YV12": (8, GREY.tobytes() + CHROMA, 0),
    "nv24": (8, GREY.tobytes() + CHROMA * 4, 0),
    "rgb8 bgr8 8UC3 RGB3 BGR3": (8, interleaved(GREY, 0, 0, 0), 0),
    "rgba8 bgra8 8UC4": (8, interleaved(GREY, 0, 0, 0, None), 0),
    "rgb16 bgr16 16UC3": (16, interleaved(picture(16), 0, 0, 0), 0),
    "rgba16 bgra16 16UC4": (16, interleaved(picture(16), 0, 0, 0, None), 0),
    "bayer_rggb8 bayer_bggr8 bayer_gbrg8 bayer_grbg8 RGGB BA81 GBRG GRBG": (8, GREY.tobytes(), 10),
    "bayer_rggb16 bayer_bggr16 bayer_gbrg16 bayer_grbg16": (16, picture(16).tobytes(), 2560),
}


def test_every_layout_is_tested() -> None:
    assert sorted(" ".join(STORED).split()) == sorted(LAYOUTS)


@pytest.mark.parametrize("padding", [0, 12])
@pytest.mark.parametrize("names", STORED)
def test_pixels_of_every_layout(names: str, padding: int) -> None:
    bits, data, change = STORED[names]
    for name in names.split():
        rows_n = round(H * LAYOUTS[name].planes)
        rows = np.frombuffer(data, np.uint8).reshape(rows_n, -1)
        padded = np.pad(rows, ((0, 0), (0, padding)), constant_values=99)
        for step in (0, padded.shape[1]):
            got = unpack(LAYOUTS[name], padded.tobytes(), (W, H), step)
            assert LAYOUTS[name].bits == bits
            assert got.dtype == (np.uint8 if bits == 8 else np.uint16)
            assert np.abs(got.astype(int) - picture(bits))[2:-2, 2:-2].max() <= change
        with pytest.raises(ValueError, match=f"image of {W}x{H} has"):
            unpack(LAYOUTS[name], padded.tobytes()[: W * H // 2], (W, H))


def test_big_endian_pixels() -> None:
    swapped = picture(16).astype(">u2").tobytes()
    assert np.array_equal(unpack(LAYOUTS["mono16"], swapped, (W, H), big_endian=True), picture(16))
    assert np.array_equal(unpack(LAYOUTS["mono8"], GREY.tobytes(), (W, H), big_endian=True), GREY)


def colour() -> np.ndarray[Any, Any]:
    """Red grows to the right, green downwards; blue is the picture."""
    y, x = np.mgrid[0:H, 0:W]
    return np.dstack([GREY, y * 255 // H, x * 255 // W]).astype(np.uint8)


def with_orientation(jpeg: bytes) -> bytes:
    """The same file with metadata that say "turn it by 90 degrees"."""
    exif = b"Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0"
    return jpeg[:2] + b"\xff\xe1" + (len(exif) + 2).to_bytes(2, "big") + exif + jpeg[2:]


def encoded(suffix: str, image: np.ndarray[Any, Any]) -> bytes:
    return cv2.imencode(suffix, image)[1].tobytes()


def from_folder(path: Path, suffix: str, data: bytes) -> Image:
    (path / "f").mkdir()
    (path / "f" / f"0{suffix}").write_bytes(data)
    return only(path / "f")


def from_mcap(path: Path, suffix: str, data: bytes) -> Image:
    message = proto("CompressedImage")(format=suffix[1:], data=data)
    return only(mcap_of(path / "a.mcap", "foxglove.CompressedImage", message.SerializeToString()))


def mcap_of(path: Path, schema: str, data: bytes, encoding: str = "protobuf") -> Path:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/i", encoding, writer.register_schema(schema, encoding, b"{}"))
        writer.add_message(channel, 1, data, 1)
        writer.finish()
    return path


def only(path: Path) -> Image:
    with closing(open_source(str(path))) as source:
        frame = next(iter(source))
    assert frame.bits == 8 * frame.image.dtype.itemsize
    return frame.image


def seen_by_camera(fourcc: str, data: bytes) -> Frame:
    """As OpenCV gives the bytes of a format that it does not know; asked for without conversion."""
    camera = FakeCamera(formats=(fourcc.ljust(4),))
    camera.shown = np.frombuffer(data, np.uint8).reshape(1, -1)
    with Opened(camera, format=fourcc.lower()) as opened:
        assert camera.captures[-1].values[cv2.CAP_PROP_CONVERT_RGB] == 0
        assert opened.source.size_px == (W, H)
        return opened.next()


JPEG = encoded(".jpg", colour())
LUMA = cv2.imdecode(np.frombuffer(JPEG, np.uint8), cv2.IMREAD_GRAYSCALE)
PICTURES: dict[str, tuple[bytes, Any]] = {
    "JPEG": (JPEG, LUMA),
    "JPEG, turned": (with_orientation(JPEG), LUMA),
    "PNG": (encoded(".png", colour()), cv2.cvtColor(colour(), cv2.COLOR_BGR2GRAY)),
    "grey PNG of 16 bits": (encoded(".png", picture(16)), picture(16)),
}


@pytest.mark.parametrize("names", STORED)
def test_the_formats_of_a_camera(names: str) -> None:
    bits, data, _ = STORED[names]
    for name in filter(str.isupper, names.replace("8UC", "").replace("16UC", "").split()):
        frame = seen_by_camera(name, data)
        assert frame.bits == bits
        assert np.array_equal(frame.image, unpack(LAYOUTS[name], data, (W, H)))


@pytest.mark.parametrize("kind", PICTURES)
def test_a_compressed_picture_is_the_same_everywhere(tmp_path: Path, kind: str) -> None:
    data, expected = PICTURES[kind]
    suffix = ".jpg" if "JPEG" in kind else ".png"
    assert np.array_equal(from_folder(tmp_path, suffix, data), expected)
    assert np.array_equal(from_mcap(tmp_path, suffix, data), expected)
    assert "JPEG" not in kind or np.array_equal(seen_by_camera("MJPG", data).image, expected)


def gif_of(path: Path) -> Path:
    PIL.Image.fromarray(GREY).save(path)
    return path


#: The picture, stored without loss, as each source gives it.
SOURCES: dict[str, Callable[[Path], Image]] = {
    "folder": lambda path: from_folder(path, ".png", encoded(".png", GREY)),
    "folder of colour": lambda path: from_folder(path, ".bmp", encoded(".bmp", cv2.merge([GREY] * 3))),
    "video": lambda path: only(video_of(path / "a.mkv", cv2.merge([GREY] * 3))),
    "grey video": lambda path: only(video_of(path / "a.avi", GREY)),
    "MCAP": lambda path: from_mcap(path, ".png", encoded(".png", GREY)),
    "camera": lambda path: seen_by_camera("GREY", GREY.tobytes()).image,
    "GIF": lambda path: only(gif_of(path / "a.gif")),
}


@pytest.mark.parametrize("source", SOURCES)
def test_one_picture_is_the_same_from_every_source(tmp_path: Path, source: str) -> None:
    assert np.array_equal(SOURCES[source](tmp_path), GREY)


RED = np.full((H, W, 3), (0, 0, 254), np.uint8)
#: Red as each kind of file stores it: suffix, and what is in it.
REDS: dict[str, np.ndarray[Any, Any]] = {
    ".png": RED, ".jpg": RED, "bgr8": RED, "rgb8": RED[..., ::-1], "rgb16": RED[..., ::-1].astype("<u2"),
    "yuyv": np.tile(np.array([81, 90, 81, 240], np.uint8), (H, W // 2)),
    "bayer_rggb8": np.tile(np.array([[254, 0], [0, 0]], np.uint8), (H // 2, W // 2)),
}  # fmt: skip


@pytest.mark.parametrize("kind", ["folder.png", "folder.jpg", ".mkv", *REDS])
def test_colour_is_kept_where_it_is_requested(tmp_path: Path, kind: str) -> None:
    path, schema = tmp_path / "a.mcap", "foxglove.RawImage"
    message = proto("RawImage")(width=W, height=H, encoding=kind, data=REDS.get(kind, RED).tobytes())
    if kind == ".mkv":
        path = video_of(tmp_path / "a.mkv", RED)
    elif kind.startswith("folder"):
        path = tmp_path / kind.replace("folder", "a")
        path.write_bytes(encoded(path.suffix, RED))
    elif "." in kind:
        schema, message = "foxglove.CompressedImage", proto("CompressedImage")(data=encoded(kind, RED))
    if path.suffix == ".mcap":
        mcap_of(path, schema, message.SerializeToString())
    with closing(open_source(str(path))) as source:
        assert isinstance(source, FileSource)
        plain = next(iter(source))
        source.keeps_colour = True
        kept = next(iter(source))
    assert plain.colour is None
    assert np.abs(np.asarray(kept.colour, int) - RED).max() <= 2
    assert np.array_equal(kept.image, plain.image)
