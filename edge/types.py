"""The types that flow between the stages; stages share nothing else.

    FrameSource -> Frame -> [pins] Pins -> [tracking] Tracks -> [cells] Cells
                -> [features] Features -> [calibration] Reading; all in a Result
                -> [link] hostlink.wire.State

Rules
- Row i is always pin i, from the rest frame on. A lost pin is NaN and `seen[i] == False`, never a
  missing row. (`Pins` fresh from full-frame detection are unordered: they have no identity yet.)
- Frames of reference are part of names. `xy_img`: px, x right, y down, pixel centres on integers.
  `xy_tip`: mm, same axes, origin on the tip's axis, z out of the skin. Images are `[row, col]`, points
  `(n, 2)` x,y; `pins` alone converts.
- Arrays that are passed on are not written to afterwards: neither by the stage that made them nor by a
  receiver. A stage that reuses a buffer states in its docstring how long it stays valid.
- Units are part of names: _px _px2 _mm _n _kpa _rad _deg _us _ns.
- What every frame makes anew is marked `per_frame`: frozen, but cheap to make.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from enum import StrEnum
from math import inf
from types import new_class
from typing import Annotated, Any, Literal, Protocol, TypeVar, dataclass_transform

import cv2
import msgspec
import numpy as np
from numpy.typing import NDArray

from edge.limits import IMAGE_SIDE_PX, ImageSide, Pixels

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Heights = NDArray[np.float32]
Mask = NDArray[np.bool_]
Index = NDArray[np.int32]
Image = NDArray[np.uint8] | NDArray[np.uint16]
T = TypeVar("T")

#: `Reading.contacts` where there is none.
NOWHERE: Array = np.empty((0, 3))


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def per_frame(cls: type[T]) -> type[T]:
    """A frozen dataclass for what every frame makes anew, with objects made by msgspec.

    A dataclass's own constructor is Python code, which takes three times as long, and when frozen more than
    1,000 instructions a field. What `dataclasses.replace`, `fields` and dask read of a
    dataclass is there too.
    """
    own = {name: value for name, value in vars(cls).items() if name not in ("__dict__", "__weakref__")}
    described = vars(dataclass(init=False, repr=False, eq=False)(cls))
    own |= {name: described[name] for name in ("__dataclass_fields__", "__dataclass_params__")}
    options = {"frozen": True}
    return new_class(cls.__name__, (msgspec.Struct,), options, lambda namespace: namespace.update(own))


#: A lens's focal length, px; beyond a hundred image sides nothing is seen at an angle.
Focal = Annotated[float, msgspec.Meta(ge=1.0, le=100 * IMAGE_SIDE_PX)]
Coefficient = Annotated[float, msgspec.Meta(ge=-1e3, le=1e3)]


class Clock(StrEnum):
    """Which clock stamped a frame."""

    DEVICE = "device"  # the camera module's own
    DRIVER = "driver"  # the kernel's or the vendor library's, host monotonic
    HOST = "host"  # our own, read when the frame arrived
    RECORDED = "recorded"  # as stored in a recording


class Polarity(StrEnum):
    """How pins stand out from the skin, as a source's address says it."""

    FOUND = ""  # not said: found when the rest frame is taken
    BRIGHT = "bright"
    DARK = "dark"


class Lens(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Distortion of a lens, in OpenCV's models and order of coefficients; also a table of files.

    model       pinhole: k1 k2 p1 p2 [k3 [k4 k5 k6 ...]]; fisheye: k1 k2 k3 k4
    size_px     of the images that it is for, width and height
    focal_px    along x and y
    centre_px   where the optical axis meets the image
    """

    model: Literal["pinhole", "fisheye"] = "pinhole"
    size_px: tuple[ImageSide, ImageSide]
    focal_px: tuple[Focal, Focal]
    centre_px: tuple[Pixels, Pixels]
    distortion: Annotated[tuple[Coefficient, ...], msgspec.Meta(min_length=4, max_length=14)]

    def __post_init__(self) -> None:
        allowed = (4,) if self.model == "fisheye" else (4, 5, 8, 12, 14)
        if len(self.distortion) not in allowed:
            numbers = " or ".join(map(str, allowed))
            raise ValueError(f"distortion: {len(self.distortion)} numbers; a {self.model} has {numbers}")


@dataclass(frozen=True, slots=True, eq=False)
class Region:
    """The part of a source's images that shows the skin: `edge.sources.region`.

    nearest_px  (h, w, 2) x, y of the pixel of the skin that is nearest to each
    views       the same of each part of the skin by itself, where it has several that do not touch
    """

    nearest_px: NDArray[np.int16]
    views: tuple[NDArray[np.int16], ...] = ()


@per_frame
class Frame:
    """One camera image.

    image       (h, w) uint8, or uint16 for 10- and 12-bit sensors; grey. `bits` of each pixel are
                significant.
    capture_ns  int, start of exposure on `clock`
    sequence    int, the camera's own counter: a gap is a frame that never arrived
    truth       true state from a simulator or rig (JSON-able), else None
    colour      (h, w, 3) BGR, to be shown, from a recording in colour that is asked for it; else None
    """

    image: Image
    capture_ns: int
    sequence: int
    clock: Clock = Clock.HOST
    bits: int = 8
    truth: dict[str, Any] | None = None
    colour: Image | None = None

    def within(self, region: Region | None) -> Frame:
        """The frame that shows the region alone: a pixel outside is as the nearest one inside."""
        if region is None or region.nearest_px.shape[:2] != self.image.shape:
            return self
        image: Any = cv2.remap(self.image, region.nearest_px, None, cv2.INTER_NEAREST)  # type: ignore[call-overload]  # the second map may be None
        return replace(self, image=image)


class FrameSource(Protocol):
    """An iterator of frames that gives the newest one and counts those that it dropped.

    Ends with StopIteration at the end of a recording; a live source ends only on `close`. Recordings are
    `edge.sources.files.FileSource`, live ones `edge.sources.live.ThreadedSource`.
    Raises SourceError when it cannot be opened; a device that is lost later is a `condition`, not an
    exception. A camera may also have `factory_lens`, a `Lens` if its maker measured it, and `refused`, the
    settings that it did not take, in words.
    """

    name: str
    size_px: tuple[int, int] = (0, 0)  # width, height
    rate_hz: float = 0.0  # nominal; 0 where unknown
    live: bool  # True: frames come at the camera's pace; False: as fast as they are read
    polarity: Polarity = Polarity.FOUND  # of its pins, as far as its address says
    lens: Lens | None = None  # whose distortion is removed from the pins' places; None: none
    region: Region | None = None  # of its images, which alone the frames show; None: all
    dropped_n: int = 0  # frames that were discarded because the reader was slow

    def __iter__(self) -> Iterator[Frame]: ...

    def close(self) -> None: ...


@per_frame
class Pins:
    """Blobs that fit the pin pattern, or one row a pin if identities are known.

    xy_img      (n, 2) float64, px; centroid; NaN where a known pin was not found
    sigma_px    (n,) float64 > 0, one-sigma noise of one coordinate of the centroid
    radius_px   (n,) float64, radius of the disc of equal area
    brightness  (n,) float64, mean grey level of the disc over its surroundings; of dark pins under them
    """

    xy_img: Array
    sigma_px: Array
    radius_px: Array
    brightness: Array

    def __len__(self) -> int:
        return len(self.xy_img)


@dataclass(frozen=True, slots=True)
class PinPattern:
    """How the pins of this tip appear to this camera; learnt from one image, never configured.

    pin_radius_px    typical radius of a pin's disc
    pitch_px         median distance of neighbouring pins
    centre_img       (2,) centre of the circle round the pins
    tip_radius_px    radius of the smallest circle round all pin centres, plus one pin radius
    background       grey level between the pins
    brightness       grey level of a pin over the background
    noise            standard deviation of the grey level between the pins, after removal of gradients
    size_px          (width, height) of the image it was learnt from
    edge_px          standard deviation of the blur of a pin's edge, pixel included; twice that of pins with
                     a ghost, if discs so blurred explain plainly more of them
    radius_range_px  smallest and largest radius (2nd and 98th percentile); (0, 0) means as pin_radius_px
    dark             the pins are darker than the skin; levels are those of the inverted image
    count            pins of the untouched tip; 0: not known, and pins cut by the view's border are not
                     searched for
    glints_img       bright arcs at rest that resemble a cut pin's edge but are none
    lens             whose distortion is removed from the pins' places, and from centre, radius, pitch, glints
                     here; None: they are as the camera sees them
    on_surface       they are dots on the skin's surface, not pins under it; named, or found by a fit
    """

    pin_radius_px: float
    pitch_px: float
    centre_img: Array
    tip_radius_px: float
    background: float
    brightness: float
    noise: float
    size_px: tuple[int, int]
    edge_px: float = 0.8
    radius_range_px: tuple[float, float] = (0.0, 0.0)
    dark: bool = False
    count: int = 0
    glints_img: tuple[tuple[float, float], ...] = ()
    lens: Lens | None = None
    on_surface: bool = False


@dataclass(frozen=True, slots=True)
class Rest:
    """The untouched tip: the frame of reference of everything after it.

    pins     row i defines pin i
    pattern  their appearance
    part     (n,) number of the part of the region that shows each pin, where it has several (mirrors): each
             has a lattice, cells and contacts of its own (`edge.geometry.parts`); None: there is one
    views    how the pins of each part appear, by its number
    beside_img (k, 2) px, pins of the other parts, where this is one of several; None: it is the whole
    since    the frame from which models count motion, if a calibration estimated it; None: this one, by
             which a touch is judged in any case
    """

    pins: Pins
    pattern: PinPattern
    part: Index | None = None
    views: tuple[PinPattern, ...] = ()
    beside_img: Array | None = None
    since: Rest | None = None

    @property
    def xy_img(self) -> Array:
        """(n, 2) px, rest position of each pin."""
        return self.pins.xy_img

    def __len__(self) -> int:
        return len(self.pins)


@per_frame
class Tracks:
    """Where each pin of the rest frame is now.

    xy_img       (n, 2) float64 px, C-contiguous; NaN where lost
    sigma_px     (n,) float64; NaN where lost
    seen         (n,) bool
    n_seen       how many are
    confidence   0..1; certainty of the identities. Below `LOW_CONFIDENCE` they must not be used.
    autocorrelation  0..1; of the pins' motion off that of their neighbours, with that of the last frame: how
                 much the last frame tells of a pin that is lost in this one; 0 if none is followed and lost
    """

    xy_img: Array
    sigma_px: Array
    seen: Mask
    n_seen: int
    confidence: float
    autocorrelation: float = 0.0

    LOW_CONFIDENCE = 0.97

    @classmethod
    def of(cls, xy_img: Array, sigma_px: Array, seen: Mask, confidence: float = 1.0) -> Tracks:
        """The tracks of one frame alone."""
        return cls(xy_img, sigma_px, seen, int(np.count_nonzero(seen)), confidence)


@per_frame
class Cells:
    """Bounded Voronoi cells of the pins.

    area_px2       (n,) float64; NaN where the pin is lost, or outside of the boundary
    rest_area_px2  (n,) float64; the same boundary rule on the rest frame
    xy_img         (n, 2) float64 px; the points tessellated: seen pins, and predictions for lost ones
    triangles      (m, 3) int32; Delaunay triangles that touch a pin; indices >= n are boundary points;
                   None: nobody draws the cells
    boundary_img   (b, 2) float64 px; the artificial points of the paper, moving with the rim
    whole_px2      (n,) float64; as `area_px2`, with a lost pin's cell at its predicted place;
                   None: no pin is lost
    gap            mean over all pins of the variance of a lost pin's predicted place, in units of the
                   variance of the motion about an affine one; 0: none is lost
    gap_img        (2,) px; mean rest place of the lost pins, weighted by that variance; None: none is lost
    """

    area_px2: Array
    rest_area_px2: Array
    xy_img: Array
    triangles: Index | None
    boundary_img: Array
    whole_px2: Array | None = None
    gap: float = 0.0
    gap_img: Array | None = None


class Feature(StrEnum):
    """A feature that can be demanded. The demand is a `frozenset[Feature]`; nothing outside it is computed.

    needs    quantities of `edge.features` that it depends on
    outputs  of calibration models that it depends on
    cells    it needs cell areas; otherwise the pins' motion
    areas    its models need them, and not only to tell when a contact begins and ends
    scaled   lengths of `Features` that it gives, <name>_px; the scale makes <name>_mm of the sample of them
    """

    needs: frozenset[str]
    outputs: frozenset[str]
    cells: bool
    areas: bool
    scaled: tuple[str, ...]

    def __new__(
        cls,
        name: str,
        needs: str = "",
        outputs: str = "",
        cells: bool = True,
        areas: bool = True,
        scaled: tuple[str, ...] = (),
    ) -> Feature:
        row = str.__new__(cls, name)
        row._value_ = name
        row.needs, row.outputs = frozenset(needs.split()), frozenset(outputs.split())
        row.cells, row.areas, row.scaled = cells, areas, scaled
        return row

    DISPLACEMENT = "displacement", "modes volume", "displacement_mm", True, False
    FORCE = (
        "force", "modes volume", "force_n contact_area_mm2 force_x_n force_y_n torque_z_nmm", True, False
    )  # fmt: skip
    PRESSURE = "pressure", "modes volume contacts", "force_n contact_area_mm2"
    CONTACT_AREA = "contact_area", "modes volume contacts", "contact_area_mm2"
    CONTACTS = "contacts", "contacts", "displacement_mm"  # the depth of a single contact
    SHEAR = "shear", "shear modes", "shear_x_mm shear_y_mm", False, False
    TORSION = "torsion", "torsion modes", "torsion_deg", False
    TILT = "tilt", "modes", "tilt_x_deg tilt_y_deg", True, False
    SLIP = "slip", "slip"
    ORIENTATION = "orientation", "contacts"
    SURFACE = "surface", "surface"  # the grid itself, for viewers and recorders
    VIBRATION = "vibration", "vibration", "", True, True, ("vibration",)


@per_frame
class FittedContact:
    """A contact as it was fitted to the pins' motion together with the others: `features.several`.

    place_img  (2,) px, where its skin lies at rest
    width      pitches, of its potential
    potential  squared pitches, of all contacts together at this place: grows with the depth of the skin there
    shear      (2,) pitches, of the skin in its middle
    dipole    (2,) pitches, the part of the shear's motion that points outwards
    """

    place_img: Array
    width: float
    potential: float
    shear: Array
    dipole: Array


@per_frame
class ContactRegion:
    """One contact: a regional maximum of the compression surface, and the region that belongs to it.

    xy_img           (2,) px, where it is in the image: `weighted_img` less what a shear adds, if the moments
                     are known
    weighted_img     (2,) px, mean of its pins' present places, weighted by area change: a shear moves it
    peak             relative area change at the maximum
    area_px2         area over the contact threshold that belongs to this maximum
    orientation_rad  direction of the long axis, in (-pi/2, pi/2], from x towards y; NaN when round
    elongation       long over short axis, >= 1
    ridge_img        (k, 2) px, the chain of maxima merged into this contact (k >= 1); of a single contact
                     also those that the pins' noise may have made
    middle_img       (2,) px, centre of gravity of the region, where its skin lies at rest
    divergence_moment_px, curl_moment_px
                     (2,) first moments of the motion's divergence, and of its curl turned by a right angle,
                     about the middle, over the sum of the divergence: how a shear shifts the contact
    fitted           by a fit of a few contacts to the pins' motion; None: not computed
    """

    xy_img: Array
    weighted_img: Array
    peak: float
    area_px2: float
    orientation_rad: float
    elongation: float
    ridge_img: Array
    middle_img: Array
    divergence_moment_px: Array
    curl_moment_px: Array
    fitted: FittedContact | None = None


@per_frame
class Features:
    """Features of the geometry, in image units. Fields not in demand are None.

    area_change     (n,) float64, (A - A_rest) / A_rest per pin; NaN where lost, and in a frame without cells
    displacement_px (n, 2) float64, local shear: motion of each pin since rest; NaN where lost
    shear_px        (2,) float64, the paper's global shear: plain mean of the seen pins' motion
    modes_px        (21,) complex128, coefficients of the motion field's polynomial on the unit disc of
                    the tip; order of terms: `features.MODE_NAMES`
    volume_px2      float, integral of the compressed (positive) part of the surface over the tip
    surface         (g, g) float64, area change on a regular grid over the tip's circle; NaN outside
    grid_img        (g,) x and (g,) y of the grid, px
    contacts        strongest first
    in_contact      False: nothing above the noise; surface and contacts were not computed
    torsion_rad     rotation of the motion field about the contact
    slip_px         float, expected rms motion within the contact since the last frame that no load explains
    slip_probability, twist_slip_probability  0..1, that more than a third of the contact's area slides:
                    of drag and twist the larger one, and of the twist; NaN, as `slip_px`: not known
    vibration_px    float, rms motion of the contact's pins above `features.params.vibration_from_hz`; 0: no
                    contact; NaN: not known yet
    vibration_to_hz float, upper end of its band: half the frame rate
    gap             as `Cells.gap`; NaN: pins are lost, and there are no cells to estimate it from
    gap_img         as `Cells.gap_img`; None too if there are no cells
    longest_px, step_px  longest motion of a pin since rest, and since the frame before; infinite: not known
    sigma_px, sigma_max_px  mean and largest sigma of the seen pins
    """

    area_change: Array
    displacement_px: Array
    in_contact: bool
    shear_px: Array | None = None
    modes_px: Complex | None = None
    volume_px2: float | None = None
    surface: Array | None = None
    grid_img: tuple[Array, Array] | None = None
    contacts: tuple[ContactRegion, ...] | None = None
    torsion_rad: float | None = None
    slip_px: float | None = None
    slip_probability: float | None = None
    twist_slip_probability: float | None = None
    vibration_px: float | None = None
    vibration_to_hz: float | None = None
    gap: float = 0.0
    gap_img: Array | None = None
    longest_px: float = inf
    step_px: float = inf
    sigma_px: float = inf
    sigma_max_px: float = inf


@per_frame
class Reading:
    """Calibrated values of one frame. NaN where not calibrated, not in demand or not trusted.

    values     by name of the wire's state field (`hostlink.wire`): displacement_mm, shear_x_mm, ...
    sigmas     by the same names: one-sigma error of the value, in its unit
    contacts   (k, 3) float64: x_mm, y_mm (tip frame), depth_mm; strongest first
    saturated  names of values that lie outside of the calibrated range
    calibrated whether a calibration that belongs to this tip was applied
    """

    values: dict[str, float]
    sigmas: dict[str, float]
    contacts: Array
    saturated: frozenset[str] = frozenset()
    calibrated: bool = False


@per_frame
class Result:
    """The result of one frame.

    cells, features  None if identities are not trusted, or nothing in demand depends on them; cells also
                     where nobody watches and the pins' motion alone shows whether something touches
    reading          empty if nothing is calibrated or trusted
    searched         True: the whole frame was searched, not only the windows; of several views, one that is
                     searched for without success while others are followed does not count
    """

    frame: Frame
    tracks: Tracks
    cells: Cells | None
    features: Features | None
    reading: Reading
    searched: bool
