"""The two panels of the paper's figures, drawn by OpenCV: left the touch, right the camera's image.

All coordinates go through `View.fixed`: fixed-point, 1/16 px, anti-aliased.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap

import cv2
import numpy as np
from numpy.typing import NDArray

from edge.errors import SinkError
from edge.types import Array, Features, Frame, Image, Mask, Pins, Tracks
from edge.view.palette import PAPER, PARAMS, Bgr, Palette, cell_colours

Canvas = NDArray[np.uint8]
_SHIFT = 4
_ONE = 1 << _SHIFT
_FONT = cv2.FONT_HERSHEY_SIMPLEX


@dataclass(frozen=True, slots=True)
class View:
    """Which part of the image a panel shows."""

    corner_img: tuple[float, float]  # (x, y) px of its upper left corner
    scale: float  # canvas px for one image px
    size: tuple[int, int]  # (width, height) of a panel, canvas px
    mm_per_px: float = 0.0  # for the scale bar; 0: in px
    palette: Palette = PAPER

    @classmethod
    def of(
        cls, xy_img: Array, pitch_px: float, height: int, mm_per_px: float = 0.0, palette: Palette = PAPER
    ) -> View:
        """A square round all pins, with space for the boundary cells and for pins that move."""
        low, high = np.nanmin(xy_img, axis=0), np.nanmax(xy_img, axis=0)
        side = float((high - low).max()) + 4 * pitch_px
        corner = (low + high) / 2 - side / 2
        at = (float(corner[0]), float(corner[1]))
        return cls(at, height / side, (height, height), mm_per_px, palette)

    def canvas(self, xy_img: Array) -> Array:
        """(n, 2) canvas px, pixel centres on integers."""
        return np.asarray((xy_img - np.array(self.corner_img) + 0.5) * self.scale - 0.5)

    def fixed(self, xy_img: Array) -> NDArray[np.int32]:
        return _fixed(self.canvas(xy_img))


def _fixed(xy: Array) -> NDArray[np.int32]:
    # A cell of a corrupt frame may reach far out; OpenCV's fixed point must not overflow.
    return np.rint(np.clip(xy, -16000, 16000) * _ONE).astype(np.int32)


def draw_touch(view: View, polygons: Sequence[Array], tracks: Tracks, features: Features | None) -> Canvas:
    """Cells (k, 2) px, row i of pin i, shaded by area change; pins, local and global shear, contact stars."""
    palette = view.palette
    canvas = np.full((view.size[1], view.size[0], 3), palette.paper, np.uint8)
    if features is not None:
        _cells(canvas, view, polygons, cell_colours(features.area_change, palette))
        _local_shear(canvas, view, tracks, features)
    seen = tracks.xy_img[tracks.seen]
    for x, y in view.fixed(seen).tolist():
        cv2.circle(canvas, (x, y), round(0.004 * view.size[1] * _ONE), palette.pin, -1, cv2.LINE_AA, _SHIFT)
    if features is not None:
        _global_shear(canvas, view, tracks, features)
        for contact in features.contacts or ():
            _star(canvas, view.canvas(contact.xy_img), view.size[1] / 40, palette)
    return canvas


def _cells(canvas: Canvas, view: View, polygons: Sequence[Array], colours: NDArray[np.uint8]) -> None:
    corners = [view.fixed(p) if len(p) >= 3 and np.isfinite(p).all() else None for p in polygons]
    for corner, colour in zip(corners, colours.tolist(), strict=True):
        if corner is not None:
            cv2.fillPoly(canvas, [corner], colour, cv2.LINE_AA, _SHIFT)
    outlines = [corner for corner in corners if corner is not None]
    cv2.polylines(canvas, outlines, True, view.palette.edge, 1, cv2.LINE_AA, _SHIFT)


def _local_shear(canvas: Canvas, view: View, tracks: Tracks, features: Features) -> None:
    """Motion of each pin since rest, `local_gain` times as long; its dot is the tail."""
    motion = features.displacement_px
    known = np.isfinite(motion).all(axis=1) & tracks.seen
    start = tracks.xy_img[known]
    ends = np.stack([view.fixed(start), view.fixed(start + PARAMS.local_gain * motion[known])], axis=1)
    width = max(1, round(view.size[1] / 480))
    cv2.polylines(canvas, list(ends), False, view.palette.local, width, cv2.LINE_AA, _SHIFT)


def _arrow(canvas: Canvas, tail: Array, head: Array, width_px: float, palette: Palette) -> None:
    """An arrow with a halo, canvas px; none where it is too short to have a direction."""
    length = float(np.hypot(*(head - tail)))
    if length < width_px:
        return
    barb = min(4.0 * width_px / length, 0.6)  # as long in each arrow
    begin, end = _fixed(np.stack([tail, head])).tolist()
    width = max(1, round(width_px))
    for colour, thickness in ((palette.halo, 3 * width), (palette.shear, width)):
        cv2.arrowedLine(canvas, begin, end, colour, thickness, cv2.LINE_AA, _SHIFT, barb)


def _global_shear(canvas: Canvas, view: View, tracks: Tracks, features: Features) -> None:
    if features.shear_px is None or not np.isfinite(features.shear_px).all():
        return
    rest = tracks.xy_img - features.displacement_px
    if not np.isfinite(rest).all(axis=1).any():
        return
    tail = view.canvas(np.nanmean(rest, axis=0))
    head = tail + PARAMS.global_gain * view.scale * features.shear_px
    _arrow(canvas, tail, head, view.size[1] / 100, view.palette)


def _star(canvas: Canvas, centre: Array, arm_px: float, palette: Palette) -> None:
    """The paper's asterisk, canvas px."""
    angles = np.arange(3) * np.pi / 3 + np.pi / 6
    arm = arm_px * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    lines = [_fixed(np.stack([centre - a, centre + a])) for a in arm]
    width = max(2, round(arm_px / 5))
    cv2.polylines(canvas, lines, False, palette.halo, 2 * width + 1, cv2.LINE_AA, _SHIFT)
    cv2.polylines(canvas, lines, False, palette.contact, width, cv2.LINE_AA, _SHIFT)


def draw_camera(view: View, image: Image, bits: int = 8, tracks: Tracks | None = None) -> Canvas:
    """The camera's image, grey or BGR, in the same view, with a ring round every pin that is tracked."""
    levels = image if image.dtype == np.uint8 else (image >> max(0, bits - 8)).astype(np.uint8)
    s = view.scale
    # canvas = s * image + t; pixel centres on integers in both
    t = view.canvas(np.zeros((1, 2)))[0]
    affine = np.array([[s, 0.0, t[0]], [0.0, s, t[1]]])
    warped = cv2.warpAffine(levels, affine, view.size, flags=cv2.INTER_LINEAR, borderValue=0.0)
    canvas = np.asarray(warped if warped.ndim == 3 else cv2.cvtColor(warped, cv2.COLOR_GRAY2BGR), np.uint8)
    if tracks is not None:
        radius = round(0.009 * view.size[1] * _ONE)
        for x, y in view.fixed(tracks.xy_img[tracks.seen]).tolist():
            cv2.circle(canvas, (x, y), radius, _RING, 1, cv2.LINE_AA, _SHIFT)
    return canvas


def save_pins_overlay(
    path: str | Path,
    image: Image,
    pins: Pins,
    clipped: Mask,
    holes_img: Array,
    rois: Sequence[Sequence[int]],
    text: Sequence[str],
) -> None:
    """The image, twice its size, with a circle of each pin's own radius and a cross at its centre.

    clipped    (n,) pins whose circle is red; holes_img  (k, 2) px, missing or left out: marked by a cross
    rois       x, y, w, h in px, drawn as rectangles; text  lines below the image
    Raises     SinkError: cannot be written
    """
    scale = 2.0
    view = View((-0.5, -0.5), scale, (int(scale * image.shape[1]), int(scale * image.shape[0])))
    canvas = draw_camera(view, image, 8 if image.dtype == np.uint8 else 16)
    marks = view.fixed(pins.xy_img).tolist(), pins.radius_px.tolist(), clipped.tolist()
    for (x, y), r, full in zip(*marks, strict=True):
        cv2.circle(canvas, (x, y), round(r * scale * _ONE), _CROSS if full else _RING, 1, cv2.LINE_AA, _SHIFT)
        cv2.drawMarker(canvas, (round(x / _ONE), round(y / _ONE)), _CROSS, cv2.MARKER_CROSS, 5, 1)
    for x, y in np.rint(view.canvas(holes_img)).astype(int).tolist():
        cv2.drawMarker(canvas, (x, y), _HOLE, cv2.MARKER_TILTED_CROSS, 14, 2)
    for left, top, wide, high in rois:
        low, far = view.canvas(np.array([[left, top], [left + wide, top + high]])).astype(int).tolist()
        cv2.rectangle(canvas, low, far, _HOLE, 1)
    if text:
        canvas = np.vstack([canvas, _written(text, canvas.shape[1])])
    try:
        written = cv2.imwrite(str(path), canvas)
    except cv2.error:  # no encoder for this suffix
        written = False
    if not written:
        raise SinkError(f"picture {path}: cannot be written; give a folder that exists and may be written to")


def _written(text: Sequence[str], width: int) -> Canvas:
    """Lines of text on paper, broken where a narrow picture would make them too small to read."""
    capital = 10.0
    most = max(20, int(1.1 * width / capital))
    text = [part for line in text for part in wrap(line, most, subsequent_indent="    ")]
    paper = np.full((round((len(text) + 1) * 2 * capital), width, 3), PAPER.paper, np.uint8)
    for n, line in enumerate(text, 1):
        _text(paper, (capital, 2 * n * capital), line, capital, PAPER.ink)
    return paper


_CROSS: Bgr = (60, 60, 255)
_HOLE: Bgr = (255, 0, 255)
_RING: Bgr = (0, 200, 255)  # amber: distinguishable from white pins and a grey image for every reader


def picture(
    view: View,
    frame: Frame,
    tracks: Tracks,
    polygons: Sequence[Array],
    features: Features | None,
    caption: str = "",
) -> Canvas:
    """Both panels, with legend, scale bar and a caption of two lines; BGR, same size for every frame."""
    width, height = view.size
    gap, foot = max(4, height // 80), round(0.12 * height)
    canvas = np.full((height + foot, 2 * width + gap, 3), view.palette.paper, np.uint8)
    canvas[:height, :width] = draw_touch(view, polygons, tracks, features)
    shown = frame.image if frame.colour is None else frame.colour
    canvas[:height, width + gap :] = draw_camera(view, shown, frame.bits, tracks)
    _legend(canvas[height:, :width], view)
    size = 0.17 * foot
    for line, text in enumerate((*_about(frame, tracks, features), *caption.splitlines())):
        at = (width + gap + 0.02 * width, height + (0.20 + 0.24 * line) * foot)
        _text(canvas, at, text, min(size, 1.5 * width / max(1, len(text))), view.palette.ink)
    return canvas


def _text(canvas: Canvas, at: tuple[float, float], text: str, size: float, colour: Bgr) -> None:
    """Left end of the base line at `at`; size is the height of a capital."""
    scale = size / 21.0  # FONT_HERSHEY_SIMPLEX at scale 1 has capitals of 21 px
    weight = max(1, round(size / 11))
    cv2.putText(canvas, text, (round(at[0]), round(at[1])), _FONT, scale, colour, weight, cv2.LINE_AA)


def _legend(foot: Canvas, view: View) -> None:
    """Colour bar of the area change, scale bar, the factors of the vectors, and the star."""
    h, w = foot.shape[:2]
    palette, size, full = view.palette, h * 0.17, PARAMS.full_change
    bar = cell_colours(np.linspace(-full, full, round(0.34 * w)), palette)
    top, bottom, left = round(0.18 * h), round(0.36 * h), round(0.03 * w)
    foot[top:bottom, left : left + len(bar)] = bar
    cv2.rectangle(foot, (left, top), (left + len(bar) - 1, bottom - 1), palette.edge, 1)
    for share, text in ((0.0, f"-{full:.0%}"), (0.5, "0"), (1.0, f"+{full:.0%}")):
        wide = cv2.getTextSize(text, _FONT, size / 21, 1)[0][0]
        x = left + share * len(bar) - (0.5 * wide if share == 0.5 else wide * share)
        _text(foot, (x, bottom + 1.6 * size), text, size, palette.ink)
    _text(foot, (left, h - 0.4 * size), "change of cell area (+ grown)", size, palette.ink)

    unit, value = _round_length(0.16 * w / view.scale, view.mm_per_px)
    length = value / (view.mm_per_px or 1.0) * view.scale
    x0, y = 0.47 * w, 0.27 * h
    cv2.line(foot, (round(x0), round(y)), (round(x0 + length), round(y)), palette.ink, 2)
    for x in (x0, x0 + length):
        cv2.line(foot, (round(x), round(y - 4)), (round(x), round(y + 4)), palette.ink, 2)
    _text(foot, (x0, bottom + 1.6 * size), f"{value:g} {unit}", size, palette.ink)

    x1, glyph = 0.66 * w, 0.06 * w
    cv2.circle(foot, (round(x1), round(y)), max(2, h // 25), palette.pin, -1, cv2.LINE_AA)
    cv2.line(foot, (round(x1), round(y)), (round(x1 + glyph), round(y)), palette.local, 2, cv2.LINE_AA)
    _text(foot, (x1 + 1.3 * glyph, y + 0.4 * size), f"pin motion x{PARAMS.local_gain:g}", size, palette.ink)
    y2 = bottom + 1.2 * size
    tail = np.array([x1, y2])
    _arrow(foot, tail, tail + np.array([glyph, 0.0]), h / 16, palette)
    mean_motion = f"mean motion x{PARAMS.global_gain:g}"
    _text(foot, (x1 + 1.3 * glyph, y2 + 0.4 * size), mean_motion, size, palette.ink)
    _star(foot, np.array([x1 + 0.5 * glyph, h - 0.9 * size]), h / 12, palette)
    _text(foot, (x1 + 1.3 * glyph, h - 0.4 * size), "contact", size, palette.ink)


def _round_length(wanted_px: float, mm_per_px: float) -> tuple[str, float]:
    """A length of 1, 2 or 5 times a power of ten near the wanted one."""
    wanted = wanted_px * (mm_per_px or 1.0)
    power = 10.0 ** np.floor(np.log10(wanted))
    value = max(step * power for step in (1.0, 2.0, 5.0) if step * power <= wanted)
    return ("mm" if mm_per_px else "px"), float(value)


def _about(frame: Frame, tracks: Tracks, features: Features | None) -> tuple[str, str]:
    """Two lines on what the picture shows."""
    first = f"frame {frame.sequence}   pins {tracks.n_seen} of {len(tracks.seen)}"
    if tracks.confidence < Tracks.LOW_CONFIDENCE:
        first += "   identities unsure"
    if features is None:
        return first, "no features"
    second = f"contacts {len(features.contacts or ())}"
    if features.shear_px is not None:
        x, y = features.shear_px
        degrees = np.degrees(np.arctan2(y, x))
        second += f"   mean motion {np.hypot(x, y):.2f} px at {degrees:+.0f} deg (x to y)"
    return first, second
