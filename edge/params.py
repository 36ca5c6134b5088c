"""Chosen numbers that several rooms share; the evidence for each is in docs/tuning.md, "Shared".

Only the standard library is imported here: the program reads it before it limits the threads of NumPy.
"""

from dataclasses import dataclass

#: Share of the pins that may be missing, or beyond a limit, for reasons of their own.
ASTRAY_REL = 0.05


@dataclass(frozen=True, slots=True)
class RuntimeParams:
    """Parameters by name. Units: s, seconds; n, items; rel, a share."""

    switch_s: float = 2e-4  # longest wait of the loop's thread for the interpreter
    rarely_s: float = 10.0  # what repeats: a flickering fault's log lines, collections of garbage, restarts
    patience_s: float = 1.0  # of waiting for a link, a client or an image, and of reporting a failed write
    stall_s: float = 0.06  # without a new image, or an item that leaves: camera or link has stalled
    announced_s: float = 0.1  # promised: so soon it is known that a device fails, is back, or has recorded
    hysteresis_rel: float = 0.1  # of the level at which a fault appears; so far back, it clears
    astray_rel: float = ASTRAY_REL  # of the pins: may be beyond a limit for reasons of their own
    noise_sigma: float = 5.0  # in one place, what is more than this many standard deviations off is no noise
    still_pitches: float = 0.08  # pins of an untouched tip that have moved less are where they were
    load_pitches: float = 1.6  # motion of a pin beyond which it counts as overloaded

    @property
    def check_s(self) -> float:
        """Between checks of what changes slowly, and between samples without images: what has stalled for as
        long as counts is then announced in time.
        """
        return self.announced_s - self.stall_s

    @property
    def wait_s(self) -> float:
        """Longest time in which a thread looks whether there is something else to do: half of what a stall
        leaves to see it, half to announce it.
        """
        return 0.5 * self.check_s

    @property
    def close_s(self) -> float:
        """How long a thread or driver that does not return is waited for: the board's checks, a link's queue,
        its threads and the camera, together for `patience_s`.
        """
        return 0.25 * self.patience_s

    @property
    def most_rel(self) -> float:
        """Share of the pins, or more: nearly all, where two frames or tips are compared. In each of the two,
        some are beyond a limit for reasons of their own.
        """
        return 1.0 - 2.0 * self.astray_rel

    @property
    def sample_n(self) -> int:
        """Number of which one may be beyond a limit for reasons of its own: of an image's rows and columns,
        of windows in it, of a window's levels to one that is noise or glare at each end, of camera periods.
        """
        return round(1.0 / self.astray_rel)

    @property
    def latencies_n(self) -> int:
        """Frames that statistics of times look back on: `sample_n` of them lie beyond their 99.9 %."""
        return 1000 * self.sample_n


PARAMS = RuntimeParams()
