"""The candidates of a fit: polynomials whose terms have the spin of their output.

Rotating tip and touch together must rotate shear, tilt and the force along the surface, and leave depth,
torsion and torque unchanged. So only products of inputs with the output's total spin can take part: 14 terms
instead of 210 for a quadratic shear.
That is why fifty frames make a usable calibration, and why a sweep along one axis calibrates the others.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from calib.fit_params import PARAMS
from calib.process_likelihood import Symmetry
from calib.targets import Targets
from edge.calibration.inputs import MODES
from edge.types import Array, Mask

Letters = Sequence[tuple[str, int]]


@dataclass(frozen=True, slots=True)
class Group:
    """Values fitted together, and the inputs that they may depend on.

    outputs   one real value, or two as x + i y
    symmetry  behaviour when tip and touch are rotated, or mirrored, together
    fitted    of a contact fitted to the pins' motion
    """

    outputs: tuple[str, ...]
    symmetry: Symmetry
    of_contact: bool = False
    fitted: bool = False

    @property
    def truth(self) -> tuple[str, ...]:
        """The values of a table that they are fitted to: a single contact's, which is one of several too."""
        return tuple(name.replace("joint_", "contact_") for name in self.outputs)

    @property
    def spin(self) -> int:
        """0: unchanged when tip and touch are rotated together; 1: rotates with them."""
        return 1 if self.symmetry is Symmetry.TURNING else 0


GROUPS = (
    Group(("displacement_mm",), Symmetry.EVEN),
    Group(("force_n",), Symmetry.EVEN),
    Group(("contact_area_mm2",), Symmetry.EVEN),
    Group(("tilt_x_deg", "tilt_y_deg"), Symmetry.TURNING),
    Group(("shear_x_mm", "shear_y_mm"), Symmetry.TURNING),
    Group(("torsion_deg",), Symmetry.ODD),
    Group(("force_x_n", "force_y_n"), Symmetry.TURNING),
    Group(("torque_z_nmm",), Symmetry.ODD),
    Group(("contact_x_mm", "contact_y_mm"), Symmetry.TURNING, of_contact=True),
    Group(("contact_depth_mm",), Symmetry.EVEN, of_contact=True),
    Group(("joint_x_mm", "joint_y_mm"), Symmetry.TURNING, of_contact=True, fitted=True),
    Group(("joint_depth_mm",), Symmetry.EVEN, of_contact=True, fitted=True),
)


MEAN_MOTION = "mean motion"  # name of the paper's candidate for shear
#: (degree of the modes, factors in a product), from simple to rich. Richer ones than these gained nothing on
#: the published recordings and need more frames than a rig can reasonably take.
SIZES = ((0, 1), (1, 1), (2, 1), (3, 1), (5, 1), (1, 2), (2, 2), (3, 2), (4, 2), (5, 2), (2, 3))

#: Terms one spin off, with the same parameters: they appear if the rig's axis misses the tip's own. On the
#: published set they halve the depth's error, and gain nothing elsewhere.
OFF_AXIS = ((2, 1), (2, 2))


def letters(degree: int) -> Letters:
    """The modes of motion up to a degree and their conjugates, each with its spin."""
    powers = [(name, 1 - int(name[1]) + int(name[2]), int(name[1]) + int(name[2])) for name in MODES]
    return [pair for name, s, d in powers if d <= degree for pair in ((name, s), (f"{name}*", -s))]


#: One contact has a place and a mean motion, which turn with the tip, a height and a size. Without the size
#: the depth error of one of several contacts is 0.6..0.7 mm rms, with it 0.2..0.3 (a ball of 3 mm anywhere
#: on simulated tips of 127 and 331 pins).
CONTACT_LETTERS: Letters = (("p", 1), ("p*", -1), ("shear", 1), ("shear*", -1), ("peak", 0))

#: The size is used for the depth only: for the place it gains nothing.
DEPTH_LETTERS: Letters = (*CONTACT_LETTERS, ("size", 0))

#: The place depends on its middle at rest, and on how a shear shifts it.
MOMENT_LETTERS: Letters = (
    ("middle", 1), ("middle*", -1), ("shear", 1), ("shear*", -1), ("divergence_moment", 1),
    ("divergence_moment*", -1), ("curl_moment", 1), ("curl_moment*", -1), ("peak", 0),
)  # fmt: skip


#: A contact fitted to the pins' motion has these for its place and depth alike.
FITTED_LETTERS: Letters = (
    ("fitted_p", 1), ("fitted_p*", -1), ("fitted_shear", 1), ("fitted_shear*", -1), ("fitted_dipole", 1),
    ("fitted_dipole*", -1), ("fitted_potential", 0), ("fitted_width", 0),
)  # fmt: skip


def terms_of_spin(spin: int, alphabet: Letters, factors: int) -> list[list[str]]:
    """Products of up to `factors` inputs with this total spin. Spin 0 includes the constant.

    Returns  input names of `edge.calibration.inputs`; a star is the conjugate
    """
    return [
        [name for name, _ in product]
        for n in range(factors + 1)
        for product in itertools.combinations_with_replacement(alphabet, n)
        if sum(s for _, s in product) == spin
    ]


def went_all_round(targets: Targets, rows: Mask) -> bool:
    """Whether shear, tilt or place covered all directions; otherwise off-axis terms cannot be determined."""
    for x, y in (group.outputs for group in GROUPS if group.spin == 1 and len(group.outputs) == 2):
        if x in targets.values and y in targets.values:
            xy = np.stack([targets.values[x][rows], targets.values[y][rows]])
            xy = xy[:, np.isfinite(xy).all(axis=0)]
            if is_round(xy):
                return True
    return False


def is_round(xy: Array) -> bool:
    """Whether vectors (2, n) cover more directions than one."""
    if xy.shape[1] < 2:
        return False
    low, high = np.linalg.eigvalsh(np.cov(xy))
    return bool(low > PARAMS.roundness_min * high)


def designs(group: Group, all_round: bool) -> Iterator[tuple[str, list[list[str]]]]:
    """Candidates by name: the terms of each."""
    if group.of_contact:
        alphabets = {"place of contact": CONTACT_LETTERS if group.spin == 1 else DEPTH_LETTERS}
        if group.spin == 1:
            alphabets["place and moments of contact"] = MOMENT_LETTERS
        if group.fitted:
            alphabets = {"fitted contact": FITTED_LETTERS}
        for (name, alphabet), factors in itertools.product(alphabets.items(), (1, 2, 3)):
            yield f"{name}{_products(factors)}", terms_of_spin(group.spin, alphabet, factors)
        return
    if group.spin == 1:
        yield MEAN_MOTION, [["shear"]]
    for (degree, factors), off in itertools.product(SIZES, (None, *OFF_AXIS) if all_round else (None,)):
        name = f"modes to degree {degree}{_products(factors)}"
        terms = terms_of_spin(group.spin, letters(degree), factors)
        if off is not None:
            name += f"; off axis: to degree {off[0]}{_products(off[1])}"
            for spin in (group.spin + 1, group.spin - 1)[: 1 + group.spin]:
                terms = terms + terms_of_spin(spin, letters(off[0]), off[1])
        yield name, terms


def _products(factors: int) -> str:
    return {1: "", 2: ", products of two"}.get(factors, ", products of three")
