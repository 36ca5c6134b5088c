"""Which known sensor a rest frame shows, and what follows: the scale, and whether pins are missing.

A sensor is recognised by its layout: nearly all pins have a site, nearly all sites a pin, and the layout
predicts them clearly better than chance. One without a known layout can only be named.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from edge.geometry.layout import LAYOUTS
from edge.rest.layout_match import CLEAR, LayoutMatch, match_layout
from edge.rest.tip_match import PARAMS as TIP
from edge.sensors import KnownSensor
from edge.types import Rest


@dataclass(frozen=True, slots=True)
class SensorMatch:
    """A sensor, and how its layout lies over the pins."""

    sensor: KnownSensor
    match: LayoutMatch


def layout_of(rest: Rest) -> tuple[str, LayoutMatch] | None:
    """The regular layout that all pins stand in; None: in none."""
    found = []
    for layout in LAYOUTS:
        try:
            match = match_layout(rest, layout, len(rest))
        except ValueError:  # that many pins make no whole pattern of this kind
            continue
        if _fits(match):
            found.append((layout, match))
    return min(found, key=lambda one: one[1].residual, default=None)


def recognise(rest: Rest, sensors: Sequence[KnownSensor]) -> SensorMatch | None:
    """The sensor that a rest frame looks like; None: like none of them."""
    kind = "dark" if rest.pattern.dark else "bright"
    candidates = [s for s in sensors if s.pins.polarity in (None, kind)]
    found = [SensorMatch(s, match) for s in candidates if (match := _match(s, rest)) is not None]
    return min(found, key=lambda one: (one.match.residual, -len(one.sensor.sources)), default=None)


def _match(sensor: KnownSensor, rest: Rest) -> LayoutMatch | None:
    """How a sensor's layout lies over the pins; None: it does not, or the sensor's is not known."""
    layout, count = sensor.pins.layout, sensor.pins.count or 0
    if layout is None or (layout != "square" and not count):
        return None
    match = match_layout(rest, layout, count)
    return match if _fits(match) else None


def _fits(match: LayoutMatch) -> bool:
    return match.pins_on >= TIP.shared_min and match.sites_filled >= TIP.shared_min and match.residual < CLEAR


def mm_per_px(sensor: KnownSensor, rest: Rest) -> float | None:
    """Scale at the middle of the pins; None: no pitch in mm is known, or the pins are not in the layout."""
    match = None if sensor.pins.pitch_mm is None else _match(sensor, rest)
    return None if match is None or sensor.pins.pitch_mm is None else sensor.pins.pitch_mm / match.pitch_px
