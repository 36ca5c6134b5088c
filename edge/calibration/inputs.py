"""Inputs of the models of a calibration, made of a frame's features, or of one contact.

Rules
- Inputs are named and dimensionless: lengths are divided by the tip's radius, areas by its square, so that
  a weight does not depend on the camera's resolution. A star behind a name means the complex conjugate.
- Vectors are complex numbers x + i y: modes of motion `c_ab` (`edge.features.modes`), place `p` on the disc.
- A feature that was not computed is NaN.
"""

MODES = tuple(f"c{a}{d - a}" for d in range(6) for a in range(d, -1, -1))  # as `edge.features.modes` has them

#: Inputs made of a frame's features; the order is that of `InputRow`. `volume` is real, `shear` the
#: plain mean of the pins' motion, `c_ab` the modes of motion; `p`, `peak`, `size` are of the strongest
#: contact, as below, all 0 if a touch is too weak for one; `gap` is real, the uncertainty due to lost pins,
#: `gap_place` their mean place on the tip's unit disc, weighted by it, 0 if none is lost.
FRAME_INPUTS: tuple[str, ...] = ("volume", "shear", *MODES, "p", "peak", "size", "gap", "gap_place")
#: The frame inputs that are the strongest contact's.
OF_PLACE = ("p", "peak", "size")
#: First moments about a contact's middle: computed only for models that depend on them.
MOMENTS = ("divergence_moment", "curl_moment")
#: Inputs of a contact fitted to the pins' motion (`edge.types.FittedContact`), computed of several contacts:
#: its place on the tip's unit disc, the others in pitches.
FITTED = ("fitted_p", "fitted_potential", "fitted_width", "fitted_shear", "fitted_dipole")
#: Inputs made of one contact: place on the tip's unit disc, height of the maximum, the frame's mean motion
#: (a shear moves the maximum within the contact), the root of the contact's area; where the contact's middle
#: lies at rest, and the first moments of divergence and curl about it; and those of the fit.
CONTACT_INPUTS: tuple[str, ...] = ("p", "peak", "shear", "size", "middle", *MOMENTS, *FITTED)
