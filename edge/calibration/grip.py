"""How much more the contact could carry: friction as seen so far, and the margin to it.

The load of the friction is one number: force along the surface and torque about its normal over the normal
force, joined by the ellipsoidal limit surface,

    load = sqrt(Fx^2 + Fy^2 + (Tz / r)^2) / Fz        r = 3 pi / 16 a

where r is the torque over the force at which a round contact of radius a and Hertz's pressure slides. A
contact slides when its load reaches the coefficient of friction. That is not known before it slides; what is
known is the largest load that it has held.

Rules
- `friction` is the largest load held in this touch, less its standard deviation: a lower bound, and the
  coefficient of friction itself once the contact has slid.
- `slip_margin` is 1 - load / friction, 0 at the least: also while a load grows beyond all that was held.
- A load within its noise does not count. Before the first beyond it, as in a mere press, neither is known.
- A contact that slides with less friction than it stuck with shows a margin; `slip_probability` shows the
  slip.
- A new touch may be another object: it begins without knowledge.

Sources  Howe, Cutkosky, "Practical force-motion models for sliding manipulation", Int. J. Robotics Research
  15, 557 (1996): limit surface; Johnson, "Contact Mechanics", section 4.2: Hertz's pressure.
"""

import math
from collections.abc import Mapping

from edge.params import PARAMS as RUNTIME

#: The values without which nothing is known.
OF_GRIP = frozenset({"force_n", "force_x_n", "force_y_n"})

#: Torque over force at which a contact of unit radius slides.
_RADIUS = 3.0 * math.pi / 16.0


class Grip:
    """Remembers the load that the present touch has held."""

    _held = 0.0

    def forget(self) -> None:
        """The touch has ended."""
        self._held = 0.0

    def update(
        self, values: Mapping[str, float], sigmas: Mapping[str, float], area_mm2: float | None
    ) -> dict[str, float]:
        """`friction` and `slip_margin` of a frame in contact; empty if they are not known.

        values, sigmas  of the frame: force_n, force_x_n, force_y_n, and torque_z_nmm if it is calibrated
        area_mm2        of the contact; None: not known, the torque is then left out
        """
        if not values.keys() >= OF_GRIP:
            return {}
        normal, x, y = values["force_n"], values["force_x_n"], values["force_y_n"]
        square = x * x + y * y
        variance = (x * sigmas["force_x_n"]) ** 2 + (y * sigmas["force_y_n"]) ** 2
        if area_mm2 is not None and area_mm2 > 0.0 and "torque_z_nmm" in values:
            radius_mm = _RADIUS * math.sqrt(area_mm2 / math.pi)
            twist = values["torque_z_nmm"] / radius_mm
            square += twist * twist
            variance += (twist * sigmas["torque_z_nmm"] / radius_mm) ** 2
        if not (normal > 0.0 and math.isfinite(square)):
            return {}
        tangential = math.sqrt(square)
        load = tangential / normal
        noise = math.sqrt(variance) / tangential if tangential else 0.0  # of the tangential load, N
        if tangential > RUNTIME.noise_sigma * noise:
            self._held = max(self._held, load - math.hypot(noise, load * sigmas["force_n"]) / normal)
        if not self._held > 0.0:
            return {}
        return {"friction": self._held, "slip_margin": max(0.0, 1.0 - load / self._held)}
