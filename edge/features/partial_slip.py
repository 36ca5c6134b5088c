"""How much of a contact slides under a tangential load, before all of it does.

A contact that is dragged slips from its rim inwards. Its core still sticks and moves with the object, by s;
the skin around it is dragged along by q, which lags more and more behind s. For a
round contact with Hertz's pressure (Mindlin)

    q(s) ~ 1 - (1 - x)^(3/2),   x = s / s_slip

where s_slip is the motion at which all of it slides, and x is also the share of the contact's area that
slides. So the curvature of q over s, of pins in the contact's core and around it, shows x: no force, no
stiffness and no coefficient of friction need be known.

The path since the touch (or since it was last pressed, released or turned back) is compared with the curves
of all x; the factor between the two is fitted, and is not negative: a drag takes its surroundings along. With
the noise of the pins and an error of the model that is a share of q, this gives each x its likelihood. Before
looking, x above one half is improbable.

Rules
- A contact that is pressed or released moves its pins too: the path begins anew.
- A contact that slides as a whole at constant load moves no pin: the last share stays.
- A twist has no core that moves: it is not seen.

Source  Mindlin, "Compliance of elastic bodies in contact", J. Appl. Mech. 16, 259 (1949).
"""

from __future__ import annotations

import math

import numpy as np

from edge.features.params import PARAMS, FeatureParams
from edge.types import Array, Index

__all__ = ["PartialSlip"]

#: Shares of the area that slides, in the middle of equal intervals; a path has as many points.
_SHARES = (np.arange(24) + 0.5) / 24
_MOST = _SHARES > 0.5


class PartialSlip:
    """The path of one touch.

    share        of the contact's area that slides; most probable mean
    probability  that it is more than half
    """

    def __init__(self, rest_xy: Array, params: FeatureParams = PARAMS) -> None:
        self._rest_xy, self._params = rest_xy, params
        self._noise = np.empty(2)  # of s and q, px
        self.forget()

    def forget(self) -> None:
        """Begin a new path with the next frame."""
        self._begin_px: Array | None = None
        self._path: list[tuple[float, float]] = []
        self._spacing_px = 0.0
        self.share = self.probability = 0.0

    def update(self, motion_px: Array, pins: Index, sigma_px: float) -> None:
        """The next frame of a contact that is not being pressed or released.

        motion_px  (n, 2) px since rest; NaN where lost; kept
        pins       (k,) rows of the pins in the contact
        sigma_px   noise of one coordinate of one pin
        """
        if self._begin_px is None:
            self._begin(motion_px, pins, sigma_px)
            return
        core = _mean(motion_px[self._core] - self._begin_px[self._core])
        s, noise = abs(core), float(self._noise[0])
        farthest = self._path[-1][0] if self._path else 0.0
        if s < farthest - self._params.contact_sigma * noise:  # turned back: it sticks again
            self.forget()
            self._begin(motion_px, pins, sigma_px)
        elif s > farthest + max(self._spacing_px, noise):
            around = _mean(motion_px[self._around] - self._begin_px[self._around])
            if not math.isnan(around.real):
                self._go_on(s, (around * core.conjugate()).real / s)

    def _go_on(self, s: float, q: float) -> None:
        """A new point of the path; every second one is dropped when there are many."""
        self._path.append((s, q))
        self._evaluate(np.array(self._path))
        if len(self._path) > len(_SHARES):
            self._path = self._path[1::2]
            self._spacing_px = s / len(self._path)

    def _begin(self, motion_px: Array, pins: Index, sigma_px: float) -> None:
        """Choose the pins of the core, an eighth of the contact or one, and those around it."""
        seen = ~np.isnan(motion_px[:, 0])
        in_contact = pins[seen[pins]]
        seen[pins] = False
        self._around = np.flatnonzero(seen)
        if len(in_contact) >= 3 and len(self._around) >= 3:
            xy = self._rest_xy[in_contact]
            far = np.hypot(*(xy - xy.mean(axis=0)).T)
            self._core = in_contact[np.argsort(far)[: max(1, len(in_contact) // 8)]]
            self._begin_px = motion_px
            # Of a mean over the pins, at the beginning and now.
            self._noise = sigma_px * np.sqrt(2.0 / np.array([len(self._core), len(self._around)]))

    def _evaluate(self, path: Array) -> None:
        """Likelihood of each share, from the path's (s, q)."""
        s, q = path.T
        noise_s, noise_q = self._noise
        curve = 1.0 - (1.0 - np.outer(_SHARES, s / s.max())) ** 1.5
        weight = 1.0 / (noise_q**2 + (q / s * noise_s) ** 2 + (self._params.slip_model_rel * q) ** 2)
        factor = np.maximum((curve * q * weight).sum(axis=1), 0.0) / (curve**2 * weight).sum(axis=1)
        square = ((q - factor[:, None] * curve) ** 2 * weight).sum(axis=1)
        likelihood = np.exp(0.5 * (square.min() - square))
        likelihood[~_MOST] *= self._params.slip_prior_odds
        likelihood /= likelihood.sum()
        self.share = float(likelihood @ _SHARES)
        self.probability = float(likelihood[_MOST].sum())


def _mean(px: Array) -> complex:
    """Mean motion of the pins that are seen, x + i y; NaN: none is."""
    x, y = (np.add.reduce(px) / len(px)).tolist()
    if math.isnan(x):
        known = px[~np.isnan(px[:, 0])]
        x, y = known.mean(axis=0).tolist() if len(known) else (math.nan, math.nan)
    return complex(x, y)
