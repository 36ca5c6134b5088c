"""The part of the images that shows the skin, where a source's address or its sensor's file says so.

    a.png?roi=40,30,560,420       a rectangle: left, top, width, height, px
    v4l2:0?circle=320,240,200     a circle: middle and radius, px
    b.mcap?mask=skin.png          a picture as large as the images: white is skin

Several rectangles or circles are parts of the skin, each in a key of its own or in one text with ";" between.
Of several kinds, the skin is what all of them show. Parts that do not touch each other are views of their
own, as mirrors give: each has its own lattice and cells. An image keeps its size, so that places and lens
stay as they are; each pixel outside becomes the nearest one inside. So the edge of the region is no step that
could be taken for a pin, and a pin that it cuts becomes a streak, which is none.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from edge.errors import SourceError
from edge.limits import PINS_MIN
from edge.sources.files import read_image
from edge.sources.options import PARTS, Options, parse_spec
from edge.types import Mask, Region

_FORMS = {"roi": "x,y,w,h", "circle": "x,y,r"}


def region_named(name: str, size_px: tuple[int, int], text: str) -> Region | None:
    """The region that a text names as an address does: "roi=0,0,99,99&mask=a.png"; "": all of the images."""
    keys = parse_spec(f"?{text}", Options()).options
    if text and keys != Options(roi=keys.roi, circle=keys.circle, mask=keys.mask):
        raise SourceError(
            f"{name}: region {text}: give roi=x,y,w,h, circle=x,y,r or mask=FILE, with & between"
        )
    return region_of(name, size_px, keys.roi, keys.circle, keys.mask)


def region_of(name: str, size_px: tuple[int, int], roi: str, circle: str, mask: str) -> Region | None:
    """The region of a source's images; None: all of them. Raises SourceError."""
    if not (roi or circle or mask):
        return None
    width, height = size_px
    y, x = np.mgrid[:height, :width]
    skin = np.ones((height, width), bool)
    if roi:
        parts = [_numbers(name, "roi", part) for part in roi.split(PARTS)]
        if any(min(a, b) < 0 or a + w > width or b + h > height for a, b, w, h in parts):
            raise SourceError(f"{name}: roi={roi} reaches out of the image; it has {width}x{height} pixels")
        skin &= np.any([(x >= a) & (x < a + w) & (y >= b) & (y < b + h) for a, b, w, h in parts], axis=0)
    if circle:
        parts = [_numbers(name, "circle", part) for part in circle.split(PARTS)]
        skin &= np.any([(x - a) ** 2 + (y - b) ** 2 <= r**2 for a, b, r in parts], axis=0)
    if mask:
        skin &= _white(name, (width, height), mask)
    if np.count_nonzero(skin) < PINS_MIN:
        where = f"{name}: the region holds no skin in images of {width}x{height}"
        raise SourceError(f"{where}; give roi or circle within them, or white in the mask")
    _, part, table, _ = cv2.connectedComponentsWithStats(skin.astype(np.uint8))
    # A speck of a mask has no room for pins of a dozen pixels.
    views = [k for k in range(1, len(table)) if table[k, cv2.CC_STAT_AREA] >= PINS_MIN**2]
    return Region(_nearest_px(skin), tuple(_nearest_px(part == k) for k in views if len(views) > 1))


def _nearest_px(skin: Mask) -> NDArray[np.int16]:
    """(h, w, 2) x, y of the pixel of the skin that is nearest to each."""
    # OpenCV labels each pixel with the nearest zero: with the nearest pixel of the skin.
    labels = cv2.distanceTransformWithLabels(
        (~skin).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )[1]
    place_of = np.zeros((int(labels.max()) + 1, 2), np.int16)
    place_of[labels[skin]] = np.argwhere(skin)[:, ::-1]
    nearest_px: NDArray[np.int16] = place_of[labels]
    return nearest_px


def _numbers(name: str, key: str, text: str) -> list[float]:
    form = _FORMS[key]
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != form.count(",") + 1 or not np.isfinite(numbers).all():
        raise SourceError(f"{name}: {key}={text}: give {key}={form} in pixels")
    return numbers


def _white(name: str, size_px: tuple[int, int], path: str) -> Mask:
    picture = read_image(path)
    if picture.shape[::-1] != size_px:
        its, images = ("{}x{}".format(*size) for size in (picture.shape[::-1], size_px))
        raise SourceError(f"{name}: mask={path} is {its}, the images are {images}; make it as large")
    white: Mask = picture > np.iinfo(picture.dtype).max // 2
    return white
