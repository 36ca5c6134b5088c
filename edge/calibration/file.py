"""The calibration file: its structure, and how it is read and replaced.

The file is JSON, versioned, checked on load (`edge.calibration.checks`) and replaced atomically. It belongs
to one tip: it holds the rest pins that it was made with, and the tare must find them again. It holds models
as data, never code:

    Curve       y = piecewise linear in one real input            the paper's displacement curve
    Polynomial  Y = sum_k weight_k * prod_j input[term_kj]        in complex inputs, complex weights;
                one output is its real part, two outputs (x, y) are its real and imaginary part
    Process     a Gaussian process with a symmetric kernel of third degree: a polynomial of which the
                covariance of the weights and the noise of each frame are known too

Every list has a maximum length and every number a range, so that the cost of a file is bounded before
anything is built from it: a frame takes at most `TERMS_MAX` products of `FACTORS_MAX` inputs for each model.
"""

import math
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np

from edge import limits
from edge.calibration.inputs import FRAME_INPUTS
from edge.errors import CalibrationError
from edge.limits import BadContent, ImageSide, Name, Number, Pixels
from edge.types import Lens, PinPattern, Pins, Rest

FORMAT = "voronoi-touch-calibration"
VERSION = 1
_GIVE = "give one that `python -m calib fit` wrote"

#: Rows of any table of a model: the square root of its covariance, of pairs as short as this, has to fit in a
#: file. The largest that `calib fit` tries has about 200.
TERMS_MAX = math.isqrt(limits.FILE_BYTES // len("[1,0.5],"))
FACTORS_MAX = len(FRAME_INPUTS)  # inputs in a product
REST_SIGMA_PX = 0.05  # noise of a rest pin: the file does not keep each pin's own

#: The unit is the output's: mm, mm2, N, Nmm, deg.
Output = Annotated[float, msgspec.Meta(ge=-1e6, le=1e6)]
Sigma = Annotated[float, msgspec.Meta(ge=1e-9, le=1e6)]
#: Logarithm, or power of one.
Exponent = Annotated[float, msgspec.Meta(ge=-100, le=100)]
Grey = Annotated[float, msgspec.Meta(ge=-65535, le=65535)]
Length = Annotated[float, msgspec.Meta(ge=0.5, le=2 * limits.IMAGE_SIDE_PX)]
Scale = Annotated[float, msgspec.Meta(ge=1e-4, le=10)]
Count = Annotated[int, msgspec.Meta(ge=0, le=int(limits.NUMBER_MAX))]

Pair = tuple[Number, Number]
Term = Annotated[list[Name], msgspec.Meta(max_length=FACTORS_MAX)]
Row = Annotated[list[Pair], msgspec.Meta(max_length=TERMS_MAX)]

#: Value names a model may have as output, and what an untouched tip reads.
UNTOUCHED: dict[str, float] = {
    "displacement_mm": 0.0,
    "force_n": 0.0,
    "force_x_n": 0.0,
    "force_y_n": 0.0,
    "torque_z_nmm": 0.0,
    "contact_area_mm2": 0.0,
    "shear_x_mm": 0.0,
    "shear_y_mm": 0.0,
    "torsion_deg": 0.0,
    "tilt_x_deg": math.nan,  # without contact there is no tilt
    "tilt_y_deg": math.nan,
}
#: Outputs of models that are evaluated once a contact, from the contact's own inputs.
CONTACT_OUTPUTS = ("contact_x_mm", "contact_y_mm", "contact_depth_mm")
#: The same, of several contacts that were fitted to the pins' motion together.
JOINT_OUTPUTS = ("joint_x_mm", "joint_y_mm", "joint_depth_mm")
VIEWS_MAX = limits.PINS_MAX // limits.PINS_MIN
MODELS_MAX = len(UNTOUCHED) + len(CONTACT_OUTPUTS) + len(JOINT_OUTPUTS)


class Curve(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="curve"):
    """A monotone curve through knots (input, output); flat beyond its ends."""

    output: Name
    input: Name
    knots: Annotated[list[tuple[Number, Output]], msgspec.Meta(min_length=2, max_length=TERMS_MAX)]
    sigma: Sigma


class _WeightedTerms(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A polynomial in complex inputs: one output (real part) or two (real and imaginary part).

    terms    each a list of input names, multiplied; [] is the constant
    weights  one (real, imaginary) pair a term; the mean, where they are known with their covariance
    valid    [low, high] of each output in the data it was fitted to
    sigma    of each output, from held-out frames
    """

    outputs: Annotated[list[Name], msgspec.Meta(min_length=1, max_length=2)]
    terms: Annotated[list[Term], msgspec.Meta(min_length=1, max_length=TERMS_MAX)]
    weights: Row
    valid: Annotated[list[tuple[Output, Output]], msgspec.Meta(max_length=2)]
    sigma: Annotated[list[Sigma], msgspec.Meta(max_length=2)]


class Polynomial(_WeightedTerms, frozen=True, forbid_unknown_fields=True, tag="moments"):
    """A polynomial with the same noise in every frame.

    spread  how the sigma widens away from the data: rows (real, imaginary) of a factor L over the terms,
            variance = sigma^2 (1 + |L psi|^2); empty: not known
    """

    spread: Annotated[list[Row], msgspec.Meta(max_length=TERMS_MAX)] = []


class Lost(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Variance that lost pins add to a value: exp(h) gap^gap_power volume^volume_power.

    In units of the model's sigma^2; `gap` and `volume` are inputs of the frame.

    scale, terms, weights  h is scale plus the real part of the terms' sum with these weights
    gap_max                largest gap that the fit tried: beyond it the value is NaN
    """

    scale: Exponent
    gap_power: Exponent
    volume_power: Exponent
    gap_max: Annotated[float, msgspec.Meta(gt=0, le=1e6)]
    terms: Annotated[list[Term], msgspec.Meta(max_length=TERMS_MAX)] = []
    weights: Annotated[list[Number], msgspec.Meta(max_length=TERMS_MAX)] = []


class Process(_WeightedTerms, frozen=True, forbid_unknown_fields=True, omit_defaults=True, tag="process"):
    """A Gaussian process with a symmetric kernel: `edge.calibration.evaluation` has the formulas.

    factor         rows (real, imaginary) of L over the terms, L^H L the covariance of the weights in units
                   of sigma^2
    far            largest |L psi|^2 that is not reported as out of range
    noise_terms    as terms; the logarithm of the noise's variance, in units of sigma^2, is the real part of
    noise_weights  their sum with these weights
    noise_range    [low, high] of that logarithm in the data
    across_weights, across_range  the same for the noise across the direction of a value with two outputs, the
                   others are then for the noise along it; empty: it is the same in all directions
    lost           None: the effect of lost pins is not known
    own            as `valid`, of this tip's frames, where another tip's model holds further: beyond, sigma
                   grows by the distance; empty: it does not
    """

    factor: Annotated[list[Row], msgspec.Meta(max_length=TERMS_MAX)]
    far: Annotated[float, msgspec.Meta(ge=0, le=1e12)]
    noise_terms: Annotated[list[Term], msgspec.Meta(max_length=TERMS_MAX)] = []
    noise_weights: Annotated[list[Number], msgspec.Meta(max_length=TERMS_MAX)] = []
    noise_range: tuple[Exponent, Exponent] = (0.0, 0.0)
    across_weights: Annotated[list[Number], msgspec.Meta(max_length=TERMS_MAX)] = []
    across_range: tuple[Exponent, Exponent] = (0.0, 0.0)
    lost: Lost | None = None
    own: Annotated[list[tuple[Output, Output]], msgspec.Meta(max_length=2)] = []


Model = Curve | Polynomial | Process


class Sensor(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """The tip and camera that the file belongs to."""

    serial: Name
    size_px: tuple[ImageSide, ImageSide]
    pin_radius_px: Length
    pitch_px: Length
    centre_px: tuple[Pixels, Pixels]
    tip_radius_px: Length
    background: Grey
    brightness: Grey
    noise: Grey
    rest_xy_px: Annotated[
        list[tuple[Pixels, Pixels]], msgspec.Meta(min_length=limits.PINS_MIN, max_length=limits.PINS_MAX)
    ]
    lens: Lens | None = None  # whose distortion is removed from places, centre, radius and pitch here
    on_surface: bool = False  # they are dots on the skin's surface
    estimated: bool = False  # the rest frame, from images that are all touched


class Data(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The data it was made from, for the record."""

    source: str
    sha256: Name
    n_frames: Count
    created: Name


class CalibrationFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """The file's top level.

    without_contact  models of touched frames in which no contact was found, instead of those of the same
                     outputs that depend on a contact's place, which give nothing there; None: such frames
                     were fitted with a place of 0, and the same models hold for them
    views            the same of each other view of this skin, where the image shows several
    """

    format: Name
    version: int
    sensor: Sensor
    mm_per_px: Scale | None
    models: Annotated[list[Model], msgspec.Meta(max_length=MODELS_MAX)]
    data: Data
    without_contact: Annotated[list[Model], msgspec.Meta(max_length=MODELS_MAX)] | None = None
    views: "Annotated[list[CalibrationFile], msgspec.Meta(max_length=VIEWS_MAX)]" = []


class _Header(msgspec.Struct, frozen=True):
    """The fields that decide whether the rest can be read."""

    format: str = ""
    version: int = 0


def read_file(path: Path) -> CalibrationFile:
    """Read a file. Raises CalibrationError: one line, file, place in it, what would be right."""
    try:
        raw = limits.read_bounded(path, limits.FILE_BYTES)
    except OSError as error:
        raise CalibrationError(f"{path}: cannot be read: {error.strerror}") from None
    except BadContent as error:
        raise CalibrationError(f"{path}: not a calibration file: {error}; {_GIVE}") from None
    return decode(raw, str(path))


def decode(raw: bytes, where: str) -> CalibrationFile:
    """A file's bytes, from disk or bus, as far as structure and ranges go. Raises CalibrationError."""
    if len(raw) > limits.FILE_BYTES:
        raise CalibrationError(f"{where}: larger than {limits.FILE_BYTES >> 10} KiB")
    try:
        header = limits.decode_json(raw, _Header)
    except BadContent as error:
        raise CalibrationError(f"{where}: not a calibration file: {error}; {_GIVE}") from None
    if header.format != FORMAT:
        raise CalibrationError(
            f"{where}: not a calibration file: its format is {limits.quote(header.format)}, not '{FORMAT}'; "
            f"{_GIVE}"
        )
    if header.version != VERSION:
        raise CalibrationError(
            f"{where}: has version {header.version}, this program reads version {VERSION}; fit it again"
        )
    try:
        return limits.decode_json(raw, CalibrationFile)
    except BadContent as error:
        raise CalibrationError(f"{where}: {error}") from None


def encode(content: CalibrationFile) -> bytes:
    return msgspec.json.encode(content) + b"\n"


def rest_of(sensor: Sensor) -> Rest:
    xy = np.array(sensor.rest_xy_px, dtype=np.float64).reshape(-1, 2)
    pattern = PinPattern(
        pin_radius_px=sensor.pin_radius_px,
        pitch_px=sensor.pitch_px,
        centre_img=np.array(sensor.centre_px),
        tip_radius_px=sensor.tip_radius_px,
        background=sensor.background,
        brightness=sensor.brightness,
        noise=sensor.noise,
        size_px=sensor.size_px,
        lens=sensor.lens,
        on_surface=sensor.on_surface,
    )
    n = len(xy)
    pins = Pins(
        xy, np.full(n, REST_SIGMA_PX), np.full(n, sensor.pin_radius_px), np.full(n, sensor.brightness)
    )
    return Rest(pins, pattern)
