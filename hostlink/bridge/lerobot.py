"""Fingers as observations of a robot in LeRobot's form; needs neither LeRobot nor PyTorch, but NumPy.

    class MyRobot(lerobot.robots.Robot):
        def connect(self, calibrate=True):
            self.touch = TactileObservation("can:can0", hand="hand.toml", slots=8)
            self.touch.connect()

        @property
        def observation_features(self):
            return {**self._motors_ft, **self._cameras_ft, **self.touch.observation_features}

        def get_observation(self):
            return {**self._read_joints_and_cameras(), **self.touch.get_observation()}

Rules
- LeRobot's datasets take numbers as `float` features, of fixed names; a tuple would be a picture. So a
  window, all samples since the last observation, is cut into `slots` equal parts, and each value of a part is
  the mean of its valid samples. With as many slots as samples come between two observations nothing is
  averaged away.
- No NaN: what is not valid is 0, and `....valid` is the share of a slot's samples that were valid, 0 to 1.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from hostlink.client import FINGER_S, Connection, connect
from hostlink.errors import UsageError
from hostlink.extras import require
from hostlink.hand_file import HandFile, read_hand
from hostlink.window import MEASURED, Window

if TYPE_CHECKING:
    import numpy as np

__all__ = ["VALUES", "TactileObservation"]

VALUES: Final = ("displacement_mm", "force_n", "shear_x_mm", "shear_y_mm", "slip_probability")


class TactileObservation:
    """The part of a robot's observation that its fingertips are.

    address  of the bus or line
    hand     the hand's file: its fingers are observed, by their names
    values   names of the wire
    slots    times that a window is cut into
    Raises   UsageError: no such value, a hand without fingers, or NumPy is not installed
    """

    def __init__(
        self, address: str, hand: HandFile | Path | str, values: Sequence[str] = VALUES, slots: int = 1
    ) -> None:
        self._numpy = require("numpy", "data")
        self._address, self._values, self._slots = address, tuple(values), slots
        self._hand = hand if isinstance(hand, HandFile) else read_hand(hand)
        unknown = [name for name in values if name not in MEASURED]
        if unknown or slots < 1 or not self._hand.mounts:
            raise UsageError(
                f"observation: give a hand with fingers, 1 slot or more, and values of {', '.join(MEASURED)}"
            )
        self._connection: Connection | None = None

    @property
    def is_connected(self) -> bool:
        return self._connection is not None

    def connect(self) -> None:
        """Open the bus, and wait for each finger. Raises LinkError."""
        self._connection = connection = connect(self._address, hand=self._hand)
        try:
            for mount in self._hand.mounts:
                connection.finger(mount.node, FINGER_S)
        except BaseException:
            self.disconnect()
            raise
        connection.window(self._values)  # from here on

    def disconnect(self) -> None:
        """Close it; `connect` may follow."""
        connection, self._connection = self._connection, None
        if connection is not None:
            connection.close()

    @property
    def observation_features(self) -> dict[str, type]:
        """`thumb.force_n` and `thumb.force_n.valid`; of several slots `thumb.force_n.0`, the oldest, ..."""
        return dict.fromkeys(self._names(), float)

    def _names(self) -> Iterator[str]:
        for mount in self._hand.mounts:
            for value in self._values:
                for slot in range(self._slots):
                    name = f"{mount.name}.{value}" + (f".{slot}" if self._slots > 1 else "")
                    yield from (name, f"{name}.valid")

    def get_observation(self) -> dict[str, float]:
        """The samples since the last observation. A silent finger is not valid. Raises VersionMismatch."""
        if self._connection is None:
            raise UsageError("observation: connect first")
        windows = self._connection.window(self._values)
        numbers: list[float] = []
        for mount in self._hand.mounts:
            means, shares = self._slotted(windows[mount.node])
            for k in range(len(self._values)):
                for slot in range(self._slots):
                    numbers += (float(means[slot, k]), float(shares[slot, k]))
        return dict(zip(self._names(), numbers, strict=True))

    def _slotted(self, window: Window) -> tuple[np.ndarray, np.ndarray]:
        """Means, and shares of samples that are valid, both (slots, values)."""
        numpy, total_n = self._numpy, len(window.time_s)
        slots = numpy.arange(total_n) * self._slots // max(total_n, 1)
        in_slot = slots == numpy.arange(self._slots)[:, None]  # (slots, n); values are 0 where not valid
        valid_n = in_slot @ window.valid.astype(float)
        means = in_slot @ window.values / numpy.maximum(valid_n, 1.0)
        return means, valid_n / numpy.maximum(in_slot.sum(axis=1, keepdims=True), 1)
