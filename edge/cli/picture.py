"""Judges a picture and its pins: `inspect` and `doctor` say the same of it, by this code.

Evidence for the limits: docs/tuning.md, "Doctor".
"""

import time
from collections.abc import Iterator, Sequence
from itertools import islice
from math import tau

import cv2
import numpy as np

from edge.cli.checks import Line, judged
from edge.errors import NoPins
from edge.faults.frame_counts import level_of
from edge.faults.image_quality import HALF_REL, ONE_LEVEL
from edge.geometry.lattice import N_RING, groups_of, inside_hull, nearest
from edge.geometry.lattice import PARAMS as LATTICE
from edge.geometry.neighbours import nearest_of
from edge.geometry.parts import parts_of
from edge.limits import PINS_MIN
from edge.params import ASTRAY_REL
from edge.params import PARAMS as RUNTIME
from edge.pins import left_out, take_rest
from edge.pins.lens import rest_as_seen
from edge.rest.symmetry import symmetry_of
from edge.rest.tip_match import SHARED_MIN
from edge.sources.live import PARAMS as LIVE
from edge.sources.live import ThreadedSource
from edge.sources.options import PARTS
from edge.sources.region import region_of
from edge.types import Array, Frame, FrameSource, Image, Index, Mask, Polarity, Rest

_AROUND = np.exp(1j * tau * np.arange(24) / 24)


def brightness(frames: Sequence[Frame], rest: Rest | None) -> Line:
    """Brightness of the images, and which share of the pins is clipped, where there are pins."""
    level, full = np.mean([level_of(f.image, f.bits) for f in frames], axis=0)
    near_one_level = level**2 * (1 << frames[0].bits) < 1.0  # by ratios, nearer to it than to white
    share = 0.0 if rest is None else float(clipped(frames[-1], rest_as_seen(rest)).mean())
    of_pins = "" if rest is None else f", {share:.0%} of the pins clipped"
    return judged(
        "light",
        f"mean level {level:.1%} of full scale, {full:.1%} of the image at full scale{of_pins}",
        (level < ONE_LEVEL, "fail", "dark: is the LED lit? raise [source] exposure_us or gain"),
        (full > 1 - HALF_REL, "fail", "overexposed: lower [source] exposure_us, keep stray light out"),
        (near_one_level, "warn", "dim: raise [source] exposure_us, then gain"),
        (share > ASTRAY_REL, "warn", "overexposed pins: lower [source] exposure_us, then the LED"),
        (full > ASTRAY_REL, "warn", "glare: lower [source] exposure_us"),
    )


def clipped(frame: Frame, rest: Rest) -> Mask:
    """(n,) whether the bright side of a pin's edge is clipped: the pin, or the skin round a dark one."""
    radii = np.array([1.4, 1.7] if rest.pattern.dark else [0.0, 0.3, 0.6])
    level = _levels(frame.image, rest, radii)
    # A pixel at full scale may read less by the noise of codec and sensor, of one level of 8 bits.
    limit = (1.0 - RUNTIME.noise_sigma * ONE_LEVEL) * ((1 << frame.bits) - 1)
    return np.asarray(np.median(level.reshape(len(rest), -1), axis=1) >= limit)


def smear_px(frame: Frame, rest: Rest) -> tuple[float, float]:
    """How much longer pins are along a motion than across, px, and its direction, deg from x towards y."""
    radii = np.arange(0.0, 2.0, 0.1)
    level = np.median(_levels(frame.image, rest, radii), axis=0)  # (directions, radii): the typical pin
    profile = (level - level[:, -5:].mean()) * (-1.0 if rest.pattern.dark else 1.0)
    weight = np.maximum(profile, 0.0) * radii
    second = (weight * radii**2).sum(axis=1) @ _AROUND**2 / weight.sum()  # difference of the variances
    r = rest.pattern.pin_radius_px
    return float(r * np.sqrt(12.0 * abs(second))), float(np.degrees(np.angle(second) / 2))


def _levels(image: Image, rest: Rest, radii: Array) -> Array:
    """(n, 24, k) grey levels round each pin in all directions, at k distances in radii of the pin."""
    x, y = rest.xy_img.T
    away = rest.pins.radius_px[:, None, None] * _AROUND[:, None] * radii
    at = (x[:, None, None] + away.real, y[:, None, None] + away.imag)
    map_x, map_y = (np.asarray(one, np.float32).reshape(len(rest), -1) for one in at)
    grey = image.astype(np.float32)
    read = cv2.remap(grey, map_x, map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(read, np.float64).reshape(away.shape)


def holes(rest: Rest) -> Array:
    """(k, 2) px, places where three neighbours agree that a pin is missing; none without a lattice."""
    parts = [part for _, part in parts_of(rest)]
    found = [_holes(p.xy_img[group]) for p in parts for group in groups(p) if len(group) >= PINS_MIN]
    return np.concatenate([np.empty((0, 2)), *found])


def _holes(xy: Array) -> Array:
    """The same for pins in one group: each pair of neighbours says where the next pin of a lattice is."""
    ring = nearest(xy, N_RING)[:, 1:]
    step = np.hypot(*(xy[ring] - xy[:, None]).transpose(2, 0, 1))
    pitch = np.median(step[:, :3], axis=1)
    row, column = np.nonzero(step < LATTICE.longest_edge * pitch[:, None])
    place, unit = 2 * xy[row] - xy[ring[row, column]], pitch[row]
    inside = inside_hull(xy, place)
    place, unit = place[inside], unit[inside]
    if len(place) == 0:
        return np.empty((0, 2))
    free = nearest_of(xy, place)[0][:, 0] > LATTICE.distance_min * unit
    if free.mean() > 1.0 - SHARED_MIN**2:  # too few places with a pin, or pins with a place: no lattice
        return np.empty((0, 2))
    place, unit = place[free], unit[free]
    found: list[Array] = []
    while len(place):
        apart, alike_row = nearest_of(place, place, N_RING)
        alike = apart < LATTICE.distance_min * unit[:, None]
        most = int(alike.sum(axis=1).argmax())
        if alike[most].sum() < 3:
            break
        found.append(np.median(place[alike_row[most, alike[most]]], axis=0))
        others = np.hypot(*(place - found[-1]).T) > unit
        place, unit = place[others], unit[others]
    return np.array(found).reshape(-1, 2)


def groups(rest: Rest) -> list[Index]:
    """Rows of the pins that stand together, the largest group first; a stray pin is a group too."""
    xy = rest.xy_img
    step, row = nearest_of(xy, xy, 1 + N_RING)
    unit = np.median(np.median(step[:, 1:4], axis=1)[row], axis=1)
    one, column = np.nonzero(step < LATTICE.longest_edge * unit[:, None])
    kind = groups_of(len(xy), one.astype(np.int32), row[one, column])
    found = [np.flatnonzero(kind == k).astype(np.int32) for k in np.unique(kind)]
    return sorted(found, key=len, reverse=True)


def settings_tried(source: FrameSource, frame: Frame, rest: Rest) -> dict[str, int]:
    """Keys for the source's address that suit this image better, and how many pins each finds: the other
    polarity, where none was asked for, and a rectangle round each group of pins: those that do not touch each
    other in one address, as parts of the skin.
    """
    found: dict[str, int] = {}
    if source.polarity is Polarity.FOUND:
        other = Polarity.BRIGHT if rest.pattern.dark else Polarity.DARK
        tried = _rest_within(source, frame, other, "")
        if tried is not None and len(tried) > len(rest):
            found[f"pins={other}"] = len(tried)
    apart = groups(rest) if source.region is None else []
    apart = [group for group in apart if len(group) >= PINS_MIN]
    polarity = Polarity.DARK if rest.pattern.dark else Polarity.BRIGHT
    alone: dict[str, int] = {}
    for group in apart if len(apart) > 1 else []:
        corner = np.maximum(rest.xy_img[group].min(axis=0) - rest.pattern.pitch_px, 0)
        size = rest.xy_img[group].max(axis=0) + rest.pattern.pitch_px - corner
        roi = ",".join(str(round(float(number))) for number in (*corner, *size))
        own = _rest_within(source, frame, polarity, roi)
        if own is not None and len(own) < len(rest):
            alone[roi] = len(own)
    if 2 * sum(alone.values()) < len(rest):  # most of the skin would be left out
        return found
    both = _rest_within(source, frame, polarity, PARTS.join(alone)) if len(alone) > 1 else None
    if both is not None and len(parts_of(both)) == len(alone):
        return found | {"&".join(f"roi={roi}" for roi in alone): len(both)}
    return found | {f"roi={roi}": n for roi, n in alone.items()}


def _rest_within(source: FrameSource, frame: Frame, polarity: Polarity, roi: str) -> Rest | None:
    """The pins within these rectangles; "": within the source's region; None: there are none."""
    region = region_of(source.name, source.size_px, roi, "", "") or source.region
    try:
        return take_rest([frame.within(region).image], polarity, source.lens, region)
    except NoPins:
        return None


def better_settings(tried: dict[str, int]) -> Line:
    apart = "pins stand in separate groups: " if any(key.startswith("roi") for key in tried) else ""
    named = ", ".join(f"?{key} finds {n}" for key, n in tried.items())
    return Line("settings", "warn", apart + named, "add one of them to the address, or the key to [source]")


def pins(frame: Frame, rest: Rest) -> Iterator[Line]:
    """Found, none missing, sharp, at rest, clear of the border and of the skin's brightness, untouched."""
    height, width = frame.image.shape
    p = rest.pattern
    kind = "dark" if p.dark else "bright"
    finding = f"{len(rest)} found, {kind}, radius {p.pin_radius_px:.1f} px, pitch {p.pitch_px:.1f} px"
    seen = rest_as_seen(rest)
    left_n = len(left_out(frame.image, seen))
    left = f"; {left_n} similar spots do not fit the pins next to them" if left_n else ""
    share = left_n / (len(rest) + left_n)
    choose = "look at them (--out): light all pins alike, or take the others out of view by ?roi= or ?mask="
    yield judged("pins", finding + left, (share > ASTRAY_REL, "warn", choose))
    missing_n = len(holes(rest))
    share = missing_n / (len(rest) + missing_n)
    clean = "clean lens and skin, light it evenly; is a pin torn out?"
    missing = f"{missing_n or 'no'} places of the lattice without a pin"
    yield judged("holes", missing, (share > ASTRAY_REL, "warn", clean))
    blur = f"edges are blurred by {p.edge_px:.1f} px, {p.edge_px / p.pin_radius_px:.0%} of a pin's radius"
    sharpen = "turn the lens until `python -m edge inspect` finds the sharpest pins; a ghost blurs them, too"
    half = HALF_REL * p.pin_radius_px**2 / 4  # of a disc's variance
    yield judged("focus", blur, (p.edge_px**2 - 1.0 > half, "warn", sharpen))  # a pixel blurs a sharp edge
    smear, direction = smear_px(frame, seen)
    longer = f"pins are {smear:.1f} px longer at {direction:.0f} degrees than across"
    hold = "hold it still and shorten [source] exposure_us; or has each pin a ghost, or is the view slanted?"
    spread = smear**2 / 12 > half  # the variance of an even motion
    yield judged("motion", longer, (spread, "warn", hold))
    top = (1 << frame.bits) - 1
    noise = f"of full scale, noise is {p.noise / top:.1%}"
    contrast = f"pins differ from the skin by {p.brightness / top:.0%} {noise}"
    # The contrast is nearer, by ratios, to the noise (rounding's at least) than to full scale.
    faint = p.brightness**2 < max(p.noise, 12**-0.5) * top
    yield judged("contrast", contrast, (faint, "warn", "light the pins better, then raise gain"))
    x, y = seen.xy_img.T
    margin = float(np.min([x, y, width - 1 - x, height - 1 - y])) - p.pin_radius_px
    centre = f"centre the tip: pins need {p.pitch_px:.0f} px of space to move"
    border = f"the outermost pin is {margin:.0f} px from the image's border"
    border = border if margin > 0.0 else "the image's border cuts pins"
    yield judged("margin", border, (margin < p.pitch_px, "warn", centre))
    symmetry = symmetry_of(rest)
    touch = "none seen, as far as one picture shows: not a light one, nor one straight onto the middle"
    if symmetry.in_contact:
        touch = f"something touches the tip: {symmetry.message}"
    let_go = "let go; or is the camera not square to the tip?"
    yield judged("touch", touch, (symmetry.in_contact, "warn", let_go))


def watch(source: FrameSource) -> list[Frame]:
    """The first images of a source, as many as a rate is measured from."""
    if not isinstance(source, ThreadedSource):
        return list(islice(source, LIVE.rate_frames_n + 1))
    frames: list[Frame] = []
    end_s = time.monotonic() + LIVE.first_s
    while len(frames) <= LIVE.rate_frames_n and time.monotonic() < end_s:
        got = source.read(RUNTIME.wait_s)
        if got is not None:
            frames.append(got)
    return frames
