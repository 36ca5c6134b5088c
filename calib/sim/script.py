"""Scenes in time: contacts over time, as tables.

A scene is a row of moves. A move takes a number of frames and ends at a pose; between two moves of the same
tool every field is interpolated linearly, so nothing jumps. A tool appears and disappears at depth
0, untouched.

Rules
- Every scene starts with REST_FRAMES untouched frames: the reader takes its rest frame from them.
- No move carries a pin further in one frame than a third of the pitch (tests/calib/test_simulator.py).
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace

from calib.sim.mechanics import Tool, ToolPose

REST_FRAMES = 8  # the number that a tare takes by default


@dataclass(frozen=True, slots=True)
class Move:
    """A number of frames; at the last one these contacts hold."""

    frames: int
    contacts: tuple[ToolPose, ...] = ()


_FLAT = ToolPose(Tool("flat"))
_BALL = ToolPose(Tool("sphere", radius_mm=3.0), x_mm=4.0, y_mm=-3.0)
_LEFT = ToolPose(Tool("sphere", radius_mm=1.5), x_mm=-5.0, y_mm=1.0)
_RIGHT = ToolPose(Tool("sphere", radius_mm=1.5), x_mm=4.5, y_mm=-2.0)
_BAR = ToolPose(Tool("edge", radius_mm=1.5, angle_deg=30.0))


def _press(contact: ToolPose, depth_mm: float, frames: int, hold: int = 4) -> tuple[Move, ...]:
    """Touch, go down, stay."""
    down = replace(contact, depth_mm=depth_mm)
    return (Move(0, (contact,)), Move(frames, (down,)), Move(hold, (down,)))


_MOVED = replace(_FLAT, depth_mm=3.0, shear_x_mm=1.2, shear_y_mm=-0.9)
_SHEAR = (*_press(_FLAT, 3.0, 14, 2), Move(12, (_MOVED,)), Move(4, (_MOVED,)))
_PAIR = (
    Move(0, (_LEFT, _RIGHT)),
    Move(12, (replace(_LEFT, depth_mm=2.0), replace(_RIGHT, depth_mm=1.6))),
    Move(4, (replace(_LEFT, depth_mm=2.0), replace(_RIGHT, depth_mm=1.6))),
)
_REST = (Move(REST_FRAMES),)
_HELD = replace(_FLAT, depth_mm=2.5)


def _drag(shear_mm: float, depth_mm: float = 2.5, twist_deg: float = 0.0) -> ToolPose:
    """The held surface dragged along one direction."""
    x_mm, y_mm = shear_mm, round(-shear_mm / 1.5, 9)
    return replace(_HELD, depth_mm=depth_mm, shear_x_mm=x_mm, shear_y_mm=y_mm, twist_deg=twist_deg)


SCENES: dict[str, tuple[Move, ...]] = {
    "nothing": (Move(16),),
    "press": (*_REST, *_press(_BALL, 3.0, 14, 4)),
    "press-shear": (*_REST, *_SHEAR),
    "two": (*_REST, *_PAIR),
    "edge": (*_REST, *_press(_BAR, 2.0, 16)),
    # Pressed, sheared, twisted and back, dragged, loosened until it slips, lifted: can be looped.
    "slip": (
        *(Move(12), Move(0, (_FLAT,)), Move(12, (_HELD,)), Move(6, (_HELD,))),
        *(Move(14, (_drag(1.2),)), Move(8, (_drag(0.6),)), Move(4, (_drag(0.6),))),
        *(Move(12, (_drag(0.6, twist_deg=5.0),)), Move(4, (_drag(0.6, twist_deg=5.0),))),
        *(Move(12, (_drag(0.6),)), Move(10, (_drag(1.8),)), Move(4, (_drag(1.8),))),
        *(Move(12, (_drag(1.8, 1.0),)), Move(5, (_drag(1.8, 0.0),)), Move(12)),
    ),
    # Everything in turn, back to untouched at the end: can be looped.
    "tour": (
        *_REST,
        *_press(_BALL, 3.0, 24),
        Move(16, (_BALL,)),
        Move(6),
        *_SHEAR,
        Move(12, (replace(_FLAT, depth_mm=3.0),)),
        Move(16, (_FLAT,)),
        Move(6),
        *_PAIR,
        Move(14, (_LEFT, _RIGHT)),
        Move(6),
        *_press(_BAR, 2.0, 16),
        Move(12, (_BAR,)),
        Move(6),
    ),
}


def shallower(moves: tuple[Move, ...], factor: float) -> tuple[Move, ...]:
    """The same with all depths and shears times the factor."""

    def scaled(c: ToolPose) -> ToolPose:
        shear_x_mm, shear_y_mm = factor * c.shear_x_mm, factor * c.shear_y_mm
        return replace(c, depth_mm=factor * c.depth_mm, shear_x_mm=shear_x_mm, shear_y_mm=shear_y_mm)

    return tuple(Move(move.frames, tuple(map(scaled, move.contacts))) for move in moves)


def play(moves: tuple[Move, ...]) -> Iterator[tuple[ToolPose, ...]]:
    """The contacts of each frame."""
    before: tuple[ToolPose, ...] = ()
    for move in moves:
        same = [c.tool for c in before] == [c.tool for c in move.contacts]
        for k in range(1, move.frames + 1):
            yield _between(before, move.contacts, k / move.frames) if same else move.contacts
        before = move.contacts


def _between(a: tuple[ToolPose, ...], b: tuple[ToolPose, ...], share: float) -> tuple[ToolPose, ...]:
    names = [f.name for f in fields(ToolPose) if f.name != "tool"]
    out = []
    for one, two in zip(a, b, strict=True):
        # Rounded so that a tool at rest has exactly the same pose in every frame, and is cached.
        values = {n: round((1 - share) * getattr(one, n) + share * getattr(two, n), 9) for n in names}
        out.append(replace(two, **values))
    return tuple(out)
