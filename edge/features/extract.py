# cython: infer_types=True
"""Features of one frame: the demand decides what is computed.

    tracks, cells --> motion, area change --> contact detector --no contact--> zeros
                                                               \\--in contact--> what is needed

Rules
- A quantity that the plan does not need is None in the result. Only motion, area change and the detector's
  bit are always computed.
- No contact: no surface, no peaks. Volume, torsion and slip are zero, contacts none; shear is computed all
  the same, and so are modes, unless the caller knows what an untouched tip reads, as a calibration does.
- Without cells everything that depends on areas stays None, area change all NaN.
- Who needs no areas needs no cells as long as the pins' motion alone shows that the contact goes on, or that
  nothing touches (`touched`). Where and when a contact begins and ends is for the areas to decide.
- State: the detector's bit and learnt noise, the last frames' motion for slip and vibration, and
  where the last frame's fits of contacts ended, from which the next ones begin. Nothing else depends on the
  frame before.
- A lost pin is put where the seen ones predict it (`Cells.xy_img`), and its cell likewise, for the modes and
  the mean motion too: a polynomial fitted to the seen pins alone is different, and in a model of many terms
  the difference is 0.25 mm of depth (331 simulated pins, 30 % dark; 0.06 mm with predicted pins).
- Lengths in px of the image, areas as a share of the cell at rest: `calibration` knows millimetres.

A frame is one call of this kernel: what it is made of meets at C level.
"""

import threading

import cython
import numpy as np
from cython.cimports.libc.math import sqrt

from edge.features.modes import Modes
from edge.features.params import PARAMS, largest_noise
from edge.features.several import DotContacts, Fits
from edge.features.surface import Surface
from edge.types import Array, Cells, Complex, ContactRegion, Feature, Features, Mask, Rest, Tracks

if cython.compiled:
    from cython.cimports.edge.features.contact_detector import ContactDetector
    from cython.cimports.edge.features.contacts import ContactFinder
    from cython.cimports.edge.features.pin_motion import AreaChange, ModeProduct, PinMotion
    from cython.cimports.edge.features.slip_and_vibration import Slip, Vibration
    from cython.cimports.edge.geometry.copies import Copies
else:
    from edge.features.contact_detector import ContactDetector
    from edge.features.contacts import ContactFinder
    from edge.features.pin_motion import AreaChange, ModeProduct, PinMotion
    from edge.features.slip_and_vibration import Slip, Vibration
    from edge.geometry.copies import Copies

NAN = cython.declare(cython.double, float("nan"))
#: Fields of `Features` that follow from areas: volume, surface, grid, contacts; and from the pins in the
#: contact: torsion, slip and its probabilities, vibration and the end of its band.
_OfAreas = tuple[float | None, Array | None, tuple[Array, Array] | None, tuple[ContactRegion, ...] | None]
_OfPins = tuple[float | None, float | None, float | None, float | None, float | None, float | None]
# Looking up a name of the module takes as long as ten numbers.
_NO_AREAS = cython.declare(tuple, (None, None, None, None))
_NO_PINS = cython.declare(tuple, (None, None, None, None, None, None))
_Features = cython.declare(object, Features)


@cython.final
@cython.cclass
class FeaturePlan:
    """The quantities that are computed for a demand: its features need them (`Feature.needs`).

    moments        False: the contacts' moments are not wanted; they are NaN
    fits           the contacts that are wanted as fitted to the pins' motion
    modes_at_rest  False: modes are not wanted of an untouched tip
    """

    shear: cython.bint
    modes: cython.bint
    volume: cython.bint
    surface: cython.bint
    contacts: cython.bint
    torsion: cython.bint
    slip: cython.bint
    vibration: cython.bint
    moments: cython.bint
    fits: cython.int
    modes_at_rest: cython.bint

    def __init__(
        self,
        demand: frozenset[Feature],
        *,
        moments: bool = True,
        fits: Fits = Fits.ALL,
        modes_at_rest: bool = True,
    ) -> None:
        needs = {need for feature in demand for need in feature.needs}
        self.shear, self.modes, self.volume = "shear" in needs, "modes" in needs, "volume" in needs
        self.surface, self.contacts = "surface" in needs, "contacts" in needs
        self.torsion, self.slip, self.vibration = "torsion" in needs, "slip" in needs, "vibration" in needs
        self.moments, self.fits, self.modes_at_rest = moments, fits, modes_at_rest


@cython.final
@cython.cclass
class FeatureExtractor:
    """Features of the frames of one tip.

    rest_area_px2  (n,) float64 px2, area of each pin's cell at rest, by the current cells' own rule
    dots           the pins are dots on the skin's surface
    """

    _n: cython.Py_ssize_t
    _rest: Rest
    _finder: ContactFinder
    _is_of_dots: cython.bint
    _dots: DotContacts | None  # made with the finder
    _making: threading.Lock  # of the finder
    _plan: FeaturePlan  # of the last frame
    _motion: PinMotion
    _xy_img: Array | None  # the places whose motion that is, until their features are there
    _n_seen: cython.Py_ssize_t  # of their pins
    _sigma_px: cython.double  # noise of one coordinate of their motion since rest
    _area_change: AreaChange
    _detector: ContactDetector
    _modes: Modes
    _mode_product: ModeProduct
    _slip: Slip
    _vibration: Vibration
    _rest_xy: cython.const[cython.double][:, ::1]
    _filled_px: cython.double[:, ::1]  # motion since rest, with lost pins predicted
    _change: cython.double[::1]
    _filled_change: cython.double[::1]
    # These are of each frame's features.
    _places: Copies
    _motions: Copies
    _changes: Copies
    _means: Copies
    _motion_array: Array  # of the frame in hand
    _largest_noise: cython.double
    _rest_variance: cython.double
    _touched: cython.bint  # whether something touched in the frame before
    _contact_sigma: cython.double
    _min_area_change: cython.double

    def __init__(self, rest: Rest, rest_area_px2: Array, dots: bool = False) -> None:
        n = len(rest)
        self._is_of_dots, self._dots = dots, None
        self._n, self._rest = n, rest
        self._motion = PinMotion(rest)
        self._xy_img, self._n_seen, self._touched = None, 0, False
        self._area_change = AreaChange(rest.xy_img, rest.pattern.pitch_px, rest_area_px2)
        self._detector = ContactDetector(rest)
        self._modes, self._vibration = Modes(rest), Vibration(rest.xy_img)
        self._mode_product = ModeProduct(self._modes.of_all)
        self._slip = Slip(rest, self._motion)
        self._rest_xy = np.ascontiguousarray(rest.xy_img)
        self._filled_px, self._filled_change = np.empty((n, 2)), np.empty(n)
        self._motion_array, self._change = np.asarray(self._motion.motion), np.empty(n)
        held_n = 2 + PARAMS.slip_span_frames
        self._motions = Copies(self._motion_array, held_n)
        self._changes = Copies(np.asarray(self._change), held_n)
        self._places = Copies(np.asarray(self._motion.xy))
        self._means = Copies(np.asarray(self._motion.mean))
        self._largest_noise = largest_noise(n)
        self._rest_variance = float(np.median(rest.pins.sigma_px)) ** 2
        self._contact_sigma, self._min_area_change = PARAMS.contact_sigma, PARAMS.min_area_change
        self._finder, self._plan = None, FeaturePlan(frozenset())
        self._making = threading.Lock()

    def prepare(self, plan: FeaturePlan) -> None:
        """Make now what otherwise the first contact would wait for (70 ms); from any thread."""
        if plan.contacts:
            self._made()

    @cython.cfunc
    def _made(self) -> ContactFinder:
        """The grid of the surface, and what finds contacts on it; made for the first contact."""
        if self._finder is None:
            with self._making:
                if self._finder is None:
                    surface = Surface(self._rest)
                    if self._is_of_dots:
                        self._dots = DotContacts(surface)
                    self._finder = ContactFinder(surface, np.asarray(self._motion.xy))
        return self._finder

    def forget_contacts(self, slip: cython.bint = False, noise: cython.bint = False) -> None:
        """The next frame's contacts do not follow from the last one's; slip, noise: nor do these."""
        if slip:
            self._slip.forget(self._touched and not noise)
        if noise:
            self._detector.forget()
        if self._finder is not None:
            self._finder.forget()

    def less_offset(self, xy_img: Array, sigma_px: Array, offset_px: Array) -> Array:
        """The places of a frame's pins less an offset, (n, 2) px, of which its features will be made."""
        self._take(xy_img, sigma_px, offset_px)
        self._xy_img = self._places.take()
        return self._xy_img

    @cython.cfunc
    def _take(self, xy_img: Array, sigma_px: Array, offset_px: Array | None) -> cython.void:
        """Compute the motion of the pins at these places, unless it is that already."""
        motion: PinMotion = self._motion
        if xy_img is not self._xy_img:
            self._xy_img, self._n_seen = xy_img, motion.since_rest(xy_img, sigma_px, offset_px)
            self._sigma_px = sqrt(motion.sigma_px * motion.sigma_px + self._rest_variance)

    def touched(
        self, tracks: Tracks, if_touched: cython.bint = True, if_untouched: cython.bint = True
    ) -> bool | None:
        """Whether the tip is touched, by the motion of its pins alone; None: `extract` needs cells.

        if_touched, if_untouched  whether areas are needed all the same while something touches, or nothing
        """
        motion: PinMotion = self._motion
        self._take(tracks.xy_img, tracks.sigma_px, None)
        if self._n_seen < self._n:
            return None
        known = self._detector.known(motion.xy, motion.mean, self._sigma_px, if_touched, if_untouched)
        return None if known < 0 else known > 0

    def extract(
        self,
        tracks: Tracks,
        cells: Cells | None,
        plan: FeaturePlan,
        touched: bool | None = None,
        capture_ns: cython.longlong = 0,
    ) -> Features:
        """The features of one frame.

        cells       of the same frame; None when nobody asked for what needs areas
        touched     as `touched` has told of it; unless it is None, no cells are needed
        capture_ns  when the frame was taken; 0: not known, and vibration neither
        Returns     Features; fields outside of the plan are None
        Raises      ValueError: sizes that do not fit
        """
        if plan is not self._plan:
            self.forget_contacts(slip=not self._plan.slip)
            self._plan = plan
        self._take(tracks.xy_img, tracks.sigma_px, None)
        self._xy_img = None  # once a frame
        n_seen, now_px, sigma_px = self._n_seen, self._motion.sigma_px, self._sigma_px
        is_filled: cython.bint = n_seen < self._n and cells is not None and self._fill(cells.xy_img, n_seen)
        change: cython.double[::1] = self._change_since_rest(cells, is_filled)
        in_contact: cython.bint = touched is True
        if touched is None and cells is not None:
            in_contact = self._detector.by_area(change, self._motion.xy, sigma_px)
        elif touched is None:
            in_contact = self._detector.by_motion(self._motion.xy, sigma_px)
        self._touched = in_contact
        modes_px, of_areas, of_pins = None, _NO_AREAS, _NO_PINS
        changes, motions = self._changes.take(), self._motions.take()
        if plan.modes and (in_contact or plan.modes_at_rest):
            modes_px = self._modes_of(None if n_seen == self._n else tracks.seen, is_filled)
        if in_contact:
            noise = self._detector.cell_noise(sigma_px)
            if cells is not None and (plan.volume or plan.surface or plan.contacts):
                of_areas = self._of_areas(change, tracks.seen, sigma_px, noise)
            if plan.torsion or plan.slip or plan.vibration:
                of_pins = self._of_contact_pins(motions, changes, now_px, noise, capture_ns)
        else:
            self._slip.forget()
            self._vibration.forget()
            self.forget_contacts()
            if cells is not None or touched is False:
                of_areas = 0.0 if plan.volume else None, None, None, () if plan.contacts else None
            slip, vibration = 0.0 if plan.slip else None, 0.0 if plan.vibration else None
            of_pins = 0.0 if plan.torsion else None, slip, slip, slip, vibration, None
        volume, surface, grid, contacts = of_areas
        torsion, slip, probability, of_twist, vibration, to_hz = of_pins
        gap = (0.0 if n_seen == self._n else NAN) if cells is None else cells.gap
        motion: PinMotion = self._motion
        # They are given by place, in the order of `Features`: names cost 3,000 instructions, tuples 1,500.
        return _Features(
            changes, motions, in_contact,
            self._means.take() if plan.shear else None, modes_px,
            volume, surface, grid, contacts, torsion, slip, probability, of_twist, vibration, to_hz,
            gap, None if cells is None else cells.gap_img,
            motion.longest_px, motion.step_px, motion.sigma_px, motion.sigma_max_px,
        )  # fmt: skip

    @cython.cfunc
    def _modes_of(self, seen: Mask | None, is_filled: cython.bint) -> Complex:
        """Modes of all pins, if lost ones are predicted or none is lost (None); else of the seen ones."""
        if is_filled:
            return self._mode_product.fit(self._filled_px)
        if seen is None:
            return self._mode_product.fit(self._motion.motion)
        if len(seen) != self._n:
            raise ValueError(f"seen ({self._n},) is wanted")
        return self._modes.fit(self._motion_array, seen)

    @cython.cfunc
    @cython.exceptval(-1)
    def _fill(self, xy: cython.const[cython.double][:, ::1], n_seen: cython.Py_ssize_t) -> cython.int:
        """Put lost pins where they are predicted; whether their motion is, too: most are seen."""
        n = self._n
        x: cython.double = 0.0
        y: cython.double = 0.0
        if xy.shape[0] != n or xy.shape[1] != 2:
            raise ValueError(f"xy_img of cells ({n}, 2) is wanted")
        for i in range(n):
            self._motion.xy[i, 0], self._motion.xy[i, 1] = xy[i, 0], xy[i, 1]
        if 2 * n_seen < max(n, 2):
            return False
        for i in range(n):
            self._filled_px[i, 0] = xy[i, 0] - self._rest_xy[i, 0]
            self._filled_px[i, 1] = xy[i, 1] - self._rest_xy[i, 1]
            x += self._filled_px[i, 0]
            y += self._filled_px[i, 1]
        self._motion.mean[0], self._motion.mean[1] = x / n, y / n
        return True

    @cython.cfunc
    def _change_since_rest(self, cells: Cells | None, is_filled: cython.bint) -> cython.double[::1]:
        """`_change`, NaN where lost; returns the same with lost pins' cells, if these are predicted."""
        if cells is None:
            self._change[:] = NAN
            return self._change
        self._area_change.since_rest(cells.area_px2, self._change)
        if is_filled and cells.whole_px2 is not None:
            self._area_change.since_rest(cells.whole_px2, self._filled_change)
            return self._filled_change
        return self._change

    @cython.cfunc
    def _of_areas(
        self, change: cython.double[::1], seen: Mask, sigma_px: cython.double, noise: cython.double
    ) -> _OfAreas:
        """The fields of a frame in contact; noise: one sigma of a cell's area change."""
        volume = picture = grid = contacts = None
        self._area_change.fill(change, self._motion.xy)
        if self._plan.volume:
            volume = self._area_change.volume(self._largest_noise * noise)
        if self._plan.surface or self._plan.contacts:
            finder: ContactFinder = self._made()
            finder.field.set_area_change(self._area_change.values)
            if self._plan.surface:
                picture, grid = finder.surface.picture(), finder.surface.grid_img
            if self._plan.contacts and self._dots is not None:
                contacts = self._dots.find(np.asarray(self._motion.xy), seen)
            elif self._plan.contacts:
                contacts = finder.find(seen, sigma_px, self._plan.moments, self._plan.fits)
        return volume, picture, grid, contacts

    @cython.cfunc
    def _of_contact_pins(
        self,
        motions: Array,
        changes: Array,
        now_px: cython.double,
        noise: cython.double,
        capture_ns: cython.longlong,
    ) -> _OfPins:
        """The fields of a frame in contact."""
        torsion = slip = probability = of_twist = rms = to_hz = None
        motion: PinMotion = self._motion
        least = max(self._contact_sigma * noise, self._min_area_change)
        motion.find_contact(self._change, least)
        if self._plan.torsion:
            torsion = motion.torsion()
        if self._plan.slip:
            self._slip.update(motions, changes, now_px, capture_ns)
            slip, probability, of_twist = self._slip.slip_px, self._slip.probability, self._slip.of_twist
            if self._slip.unseen:
                slip = probability = of_twist = NAN
        if self._plan.vibration:
            rms, to_hz = self._vibration.update(motion.motion, motion.pins, motion.n_pins, now_px, capture_ns)
        return torsion, slip, probability, of_twist, rms, to_hz
