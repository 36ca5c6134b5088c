# cython: infer_types=True
"""Which of the pins found at the predicted places are seen. A kernel: compiled by Cython, and the same
when it is not.

Idea: each found pin's motion since rest is compared with the motion that its neighbours predict for it (a
constant sparse matrix), twice: the second time without the pins that the first rejected. The difference, the
residual, changes little from one frame to the next. Motion and matrix are in single precision: an error of
1e-6 px, for half of the memory.

    found -> residual and its innovation -> two on one blob -> photometric outliers -> positions of all pins

In most frames all pins are found, each so near to its last place that no residual can have changed by too
much. Then only those of pins with an anomalous brightness or sigma are computed.

A rejected pin counts as lost, not as moved: it moves with its neighbours, and of its residual as much is left
as of the others', which the frame tells: their autocorrelation with those of the last one.

Loops that store take their arrays as local names: the C compiler then knows that the arrays stay where they
are, and does not look their address up again after every store.
"""

from collections.abc import Callable

import cython
import numpy as np
from cython.cimports.libc.math import sqrt

from edge.geometry.lattice import Lattice
from edge.geometry.neighbours import weighted_rows
from edge.limits import PINS_MAX
from edge.tracking.params import TrackingParams
from edge.types import Array, Mask, Pins

if cython.compiled:
    from cython.cimports.edge.geometry.copies import Copies
    from cython.cimports.edge.geometry.neighbours import Separation, weighted_sums
    from cython.cimports.edge.tracking.outliers import PhotometricFilter
else:
    from edge.geometry.copies import Copies
    from edge.geometry.neighbours import Separation, weighted_sums
    from edge.tracking.outliers import PhotometricFilter

HUGE_VAL = cython.declare(cython.double, float("inf"))
NAN = cython.declare(cython.double, float("nan"))


@cython.final
@cython.cclass
class Follower:
    """The pins of one tip from frame to frame.

    lattice      of the rest frame
    photometric  of the same tip
    found        the pins that were found where they were expected, row i is pin i, NaN where nothing was
                 found; written before `follow`
    expected     (n, 2) px, places in the next frame; written
    Raises       ValueError: another number of pins, a pin that does not exist
    """

    n: cython.Py_ssize_t
    photometric: PhotometricFilter
    # These belong to the tip.
    rest: cython.const[cython.double][:, ::1]
    pitch2: cython.const[cython.double][::1]  # px2, square of the local pitch
    pitch_min: cython.double  # px
    change2: cython.double  # limit of the square of a residual's change, in `pitch2`
    leap2: cython.double  # of an innovation: a leap, and so far that pins are others' neighbours, likewise
    gate2: cython.double
    full_share_min: cython.double
    baseline_share_min: cython.double
    baseline_frames: cython.double
    damping: cython.double  # share of a frame's motion that is expected again
    start: cython.int[::1]  # of `weighted_rows`, where all neighbours are known
    near: cython.ushort[::1]
    weight: cython.float[::1]
    gain: cython.double  # a residual changes by so many times the longest step of a pin, at most
    closest: cython.int[:, ::1]
    pairs: cython.int[:, ::1]
    distance_min: cython.double[::1]
    separation: Separation
    # These belong to the last frame that was accepted.
    last: cython.double[:, ::1]
    expected: cython.double[:, ::1]
    last_residual: cython.float[::1]  # (2 n,), unless it was not needed
    is_recalled: cython.bint  # `last_residual` is that frame's
    residual_most: cython.double  # px, no residual is longer
    step_most: cython.double  # px, the longest step of a pin; infinite: one was not seen
    last_seen: cython.uchar[::1]
    baseline_share: cython.double  # of the pins, seen lately
    doubted_n: cython.Py_ssize_t  # pins that a search did not find where a blob is, the fewest since
    # These belong to the frame in hand.
    found: cython.double[:, ::1]
    leapt: cython.uchar[::1]  # out of the window that was read
    sigma: cython.const[cython.double][::1]
    brightness: cython.const[cython.double][::1]
    found_xy: Copies
    found_sigma: Copies
    results: tuple[Copies, Copies, Copies]  # of `follow`, and their memory
    result_xy: cython.double[:, ::1]
    result_sigma: cython.double[::1]
    result_seen: cython.uchar[::1]
    all_seen: Mask  # shared by frames, read-only
    now: cython.double[:, ::1]
    residual: cython.float[::1]  # (2 n,)
    seen: cython.uchar[::1]
    share: cython.double  # of the pins that are seen
    autocorrelation: cython.double  # of the residuals with those of the last frame
    predicted: cython.float[::1]  # (2 n,) motion since rest, by the neighbours
    known: cython.float[::1]  # (2 n,) motion that they predict from

    def __init__(
        self,
        lattice: Lattice,
        photometric: PhotometricFilter,
        params: TrackingParams,
        found: Pins,
        expected: Array,
    ) -> None:
        n = lattice.n
        _check(lattice, photometric.n)
        sizes = (found.xy_img.shape, found.sigma_px.shape, found.brightness.shape, expected.shape)
        if sizes != ((n, 2), (n,), (n,), (n, 2)):
            raise ValueError(f"found and expected of {n} pins are wanted, not {sizes}")
        self.found, self.sigma = found.xy_img, found.sigma_px
        self.found_xy, self.found_sigma = Copies(found.xy_img), Copies(found.sigma_px)
        self.brightness = found.brightness
        self.n = n
        self.photometric = photometric
        self.rest = np.ascontiguousarray(lattice.rest_xy, np.float64)
        self.pitch2 = np.square(lattice.local_pitch_px)
        self.pitch_min = float(np.min(lattice.local_pitch_px, initial=HUGE_VAL))
        self.change2 = params.innovation_max**2
        self.leap2, self.gate2 = params.leap_innovation**2, params.gate**2
        self.full_share_min, self.baseline_share_min = params.full_share_min, params.baseline_share_min
        self.damping = params.velocity_damping
        self.baseline_frames = params.baseline_frames
        full = np.take_along_axis(photometric.affine.matrix(), lattice.near, 1)
        full[lattice.weight <= 0.0] = 0.0
        self.gain = 1.0 + np.abs(full).sum(axis=1).max(initial=0.0)
        self.start, self.near, self.weight = weighted_rows(lattice.near, full)
        self.closest = np.array(lattice.closest, np.int32, order="C")
        self.pairs = np.array(lattice.pairs, np.int32, order="C")
        self.distance_min = np.array(lattice.distance_min_px, np.float64)
        self.separation = Separation(n)
        self.last, self.last_residual = np.empty((n, 2)), np.empty(2 * n, np.float32)
        self.expected = expected
        self.now, self.residual = np.empty((n, 2)), np.empty(2 * n, np.float32)
        self.predicted, self.known = np.empty((2, 2 * n), np.float32)
        self.last_seen, self.seen, self.leapt = np.empty((3, n), np.uint8)
        xy, sigma, seen = np.empty((n, 2)), np.empty(n), np.empty(n, np.bool_)
        self.results = Copies(xy), Copies(sigma), Copies(seen)
        self.result_xy, self.result_sigma, self.result_seen = xy, sigma, seen.view(np.uint8)
        self.all_seen = np.ones(n, np.bool_)
        self.all_seen.flags.writeable = False
        self.reset()

    def reset(self) -> None:
        """Start from rest, with no pin seen."""
        self.last[:] = self.rest
        self.expected[:] = self.rest
        self.last_residual[:] = 0
        self.last_seen[:] = False
        self.is_recalled, self.residual_most, self.step_most = True, 0.0, HUGE_VAL
        self.baseline_share = 0.0
        self.doubted_n = 0

    def last_xy(self) -> Array:
        """(n, 2) px, where each pin was in the last frame that was accepted."""
        return np.array(self.last)

    def follow(
        self, again: Callable[[], object] | None = None
    ) -> tuple[Array, Array, Mask, int, float, bool, bool]:
        """Evaluate one frame, and make it the last one if the identities are held in it.

        again    writes `found` once more, what is found at `expected`; None: it cannot
        Returns  (n, 2) px and (n,) px, place and sigma of the seen pins, NaN elsewhere; (n,) bool, seen,
                 perhaps read-only; how many are seen; the autocorrelation of the residuals, 0 if no pin is
                 lost; whether each pin went on to its own place and not its neighbour's, of which most pins
                 are to tell; whether the identities are held: that, and enough pins
        """
        n: cython.Py_ssize_t = self.n
        seen_n: cython.Py_ssize_t
        leapt: cython.bint
        strayed: cython.bint
        goes_on: cython.bint
        is_held: cython.bint
        if self._follow_short_steps(self.found):
            return self.found_xy.take(), self.found_sigma.take(), self.all_seen, n, 0.0, True, True
        self._recall()
        seen_n = self._evaluate()
        self.share = cython.cast(cython.double, seen_n) / n
        strayed = leapt = self._is_median_beyond(self.now, self.leap2)
        if leapt:
            strayed = self._is_median_beyond(self.now, self.gate2)
        goes_on = 2.0 * self.share >= 1.0 and not strayed
        is_held = goes_on and not self._is_too_few(leapt)
        if again is not None and is_held and seen_n < n:
            leapt_n = self._count_leapt()
            is_held = leapt_n <= (1.0 - self.full_share_min) * n
            if is_held and leapt_n:
                seen_n = self._follow_leapt(again, seen_n)
                self.share = cython.cast(cython.double, seen_n) / n
        self.baseline_share += (self.share - self.baseline_share) / self.baseline_frames
        self.step_most = HUGE_VAL
        if is_held:
            self._accept()
        xy, sigma, seen = [copies.take() for copies in self.results]
        return xy, sigma, seen, seen_n, self.autocorrelation, goes_on, is_held

    @cython.cfunc
    def _evaluate(self) -> cython.Py_ssize_t:
        """Which pins are seen, and where all are; how many are seen."""
        self._find_residuals(self.found)
        self._keep_apart(self.found, HUGE_VAL)
        self._filter(self.found, True)
        return self._place(self.found, self.sigma)

    def accept(self) -> None:
        """Make the frame that was followed the last one, though few pins are seen: a search found no more."""
        self.doubted_n = self._count_refused()
        self._accept()

    def settle(self, xy: Array, residual: Array, seen: Mask) -> float:
        """Make what a search found the last frame, at a standstill.

        xy, residual  (n, 2) px, of all pins; seen (n,) bool
        Returns       autocorrelation of the residuals with those of the frame that was the last
        Raises        ValueError: sizes that do not fit
        """
        if xy.shape != (self.n, 2) or residual.shape != (self.n, 2) or seen.shape != (self.n,):
            raise ValueError(f"xy ({self.n}, 2), residual ({self.n}, 2) and seen ({self.n},) are wanted")
        is_seen = np.array(seen, np.bool_).view(np.uint8)
        self._recall()
        self.step_most = HUGE_VAL
        self.autocorrelation = self._correlate(residual.astype(np.float32).ravel(), is_seen)
        where: cython.const[cython.double][:, ::1] = np.ascontiguousarray(xy, np.float64)
        self.last[:, :] = where
        self.expected[:, :] = where
        np.asarray(self.last_residual)[:] = residual.ravel()
        np.asarray(self.last_seen)[:] = is_seen
        self.baseline_share = np.count_nonzero(seen) / self.n
        np.asarray(self.seen)[:] = is_seen
        self.doubted_n = self._count_refused()
        return float(self.autocorrelation)

    def strayed(self, xy: Array) -> bool:
        """Whether the median pin is too far from where it was predicted to be known by that; xy (n, 2) px."""
        if xy.shape != (self.n, 2):
            raise ValueError(f"xy ({self.n}, 2) is wanted, not {xy.shape}")
        return self._is_median_beyond(np.ascontiguousarray(xy, np.float64), self.gate2)

    @cython.cfunc
    def _follow_short_steps(self, found: cython.const[cython.double][:, ::1]) -> cython.bint:
        """Make the frame in hand the last one if all pins are seen in both, too near to their last places for
        a residual to be out of bounds, or for two to be on one blob; else `follow` decides with residuals.
        """
        last: cython.double[:, ::1] = self.last
        expected: cython.double[:, ::1] = self.expected
        longest2: cython.double = 0.0
        total: cython.double = 0.0  # NaN where a pin was not found
        damping: cython.double = self.damping
        if self.step_most == HUGE_VAL:
            return False
        for i in range(self.n):
            dx = found[i, 0] - last[i, 0]
            dy = found[i, 1] - last[i, 1]
            step2 = dx * dx + dy * dy
            total += step2
            longest2 = step2 if step2 > longest2 else longest2
        step = sqrt(longest2)
        change = self.gain * step
        if not (
            total == total
            and change * change < self.change2 * self.pitch_min * self.pitch_min
            and step + damping * self.step_most < sqrt(self.leap2) * self.pitch_min
        ):
            return False
        self.seen[:] = True
        most = self.residual_most + change
        if not most < self.pitch_min:  # of many steps since the residuals were computed
            most = self._find_all_residuals(found, self.residual)
        if not most < self.pitch_min:
            return False
        self._keep_apart(found, step)
        self._filter(found, False)
        if _any_missing(self.seen):
            return False
        for i in range(self.n):
            for d in range(2):
                at = found[i, d]
                expected[i, d] = at + damping * (at - last[i, d])
                last[i, d] = at
        self.is_recalled, self.residual_most, self.step_most = False, most, step
        self.baseline_share += (1.0 - self.baseline_share) / self.baseline_frames
        self.doubted_n = 0
        return True

    @cython.cfunc
    def _recall(self) -> cython.void:
        """Compute the residuals of the last frame, if they were not needed then; all its pins were seen."""
        if self.is_recalled:
            return
        self.is_recalled = True
        self.seen[:] = True
        self._find_all_residuals(self.last, self.last_residual)

    @cython.cfunc
    def _find_all_residuals(
        self, xy: cython.const[cython.double][:, ::1], residual: cython.float[::1]
    ) -> cython.double:
        """Residuals in a frame all of whose pins are marked as seen; the longest, px."""
        longest2: cython.double = 0.0
        self._predict_from_neighbours(xy, True)
        for i in range(self.n):
            longest2 = max(longest2, self._set_residual(xy, residual, i))
        return sqrt(longest2)

    @cython.cfunc
    def _find_residuals(self, found: cython.const[cython.double][:, ::1]) -> cython.void:
        """Residuals of all found pins; those are seen whose residual is like that of the last frame."""
        seen: cython.uchar[::1] = self.seen
        for i in range(self.n):
            seen[i] = found[i, 0] == found[i, 0]
        for iteration in range(2):
            # A lost pin moves with its neighbours; some of these may be lost themselves and move with theirs.
            for step in range(2 if _any_missing(seen) else 1):
                self._predict_from_neighbours(found, iteration == 0 and step == 0)
            if not self._reject_by_residual(found):
                break

    @cython.cfunc
    def _predict_from_neighbours(
        self, found: cython.const[cython.double][:, ::1], first: cython.bint
    ) -> cython.void:
        """Motion of each pin as predicted by its neighbours. A neighbour that is not seen takes part with its
        own prediction; first: there is none yet in this frame.
        """
        known: cython.float[::1] = self.known
        for i in range(self.n):
            for d in range(2):
                if self.seen[i]:
                    known[2 * i + d] = cython.cast(cython.float, found[i, d] - self.rest[i, d])
                elif first:
                    known[2 * i + d] = self.expected[i, d] - self.rest[i, d]
                else:
                    known[2 * i + d] = self.predicted[2 * i + d] + self.last_residual[2 * i + d]
        weighted_sums(self.start, self.near, self.weight, known, self.predicted)

    @cython.cfunc
    @cython.inline
    def _set_residual(
        self, xy: cython.const[cython.double][:, ::1], residual: cython.float[::1], i: cython.Py_ssize_t
    ) -> cython.double:
        """The motion of pin i since rest beside what its neighbours predict; the square of its length."""
        x: cython.double
        y: cython.double
        for d in range(2):
            own = xy[i, d] - self.rest[i, d] - self.predicted[2 * i + d]
            residual[2 * i + d] = cython.cast(cython.float, own)
        x, y = residual[2 * i], residual[2 * i + 1]
        return x * x + y * y

    @cython.cfunc
    def _reject_by_residual(self, found: cython.const[cython.double][:, ::1]) -> cython.bint:
        """Update which pins are seen, by the residual and its change; true if that altered any.

        A pitch off, a pin is in another's place; half a pitch off, a blob is nearer to that place. If the pin
        was seen in the last frame, it is known whose the blob is. The last residual of a lost pin is a
        prediction as well, which makes the variance of its change twice as large; the pin returns where most
        of its nearest were seen.
        """
        residual: cython.float[::1] = self.residual
        last: cython.float[::1] = self.last_residual
        seen: cython.uchar[::1] = self.seen
        is_within: cython.uchar
        changed: cython.uchar = 0
        longest2: cython.double = 0.0
        for i in range(self.n):
            most2 = change2 = self.pitch2[i]
            if not self.last_seen[i]:
                most2 *= 0.5**2
                change2 *= 2.0 if 2 * self._seen_near(i) >= self.closest.shape[1] else 0.0
            size2 = self._set_residual(found, residual, i)
            dx = cython.cast(cython.double, residual[2 * i]) - last[2 * i]
            dy = cython.cast(cython.double, residual[2 * i + 1]) - last[2 * i + 1]
            longest2 = size2 if size2 > longest2 else longest2
            # NaN, not found, is not within.
            is_within = (size2 < most2) & (dx * dx + dy * dy < self.change2 * change2)
            changed |= is_within ^ seen[i]
            seen[i] = is_within
        self.residual_most = sqrt(longest2)
        return changed != 0

    @cython.cfunc
    def _keep_apart(self, found: cython.const[cython.double][:, ::1], step: cython.double) -> cython.void:
        """Lose the one with the larger innovation of two pins that came too near; step as of `Separation`."""
        if self.separation.holds(found, step):
            return
        least: cython.double = HUGE_VAL
        for p in range(self.pairs.shape[0]):
            a = self.pairs[p, 0]
            b = self.pairs[p, 1]
            dx = found[a, 0] - found[b, 0]
            dy = found[a, 1] - found[b, 1]
            gap = sqrt(dx * dx + dy * dy) - self.distance_min[p]
            least = min(least, gap)
            if gap < 0 and self.seen[a] and self.seen[b]:
                self.seen[a if self._innovation2(a) > self._innovation2(b) else b] = False
        self.separation.renew(found, least)

    @cython.cfunc
    @cython.inline
    def _innovation2(self, i: cython.Py_ssize_t) -> cython.double:
        """Square of the change of a residual, px2."""
        dx: cython.double = self.residual[2 * i] - self.last_residual[2 * i]
        dy: cython.double = self.residual[2 * i + 1] - self.last_residual[2 * i + 1]
        return dx * dx + dy * dy

    @cython.cfunc
    def _filter(self, found: cython.const[cython.double][:, ::1], has_residuals: cython.bint) -> cython.void:
        """Reject the photometric outliers among the seen pins; has_residuals: these are computed."""
        if not self.photometric.find_doubts(self.brightness, self.sigma, self.seen, False):
            return
        motion: cython.double[:, ::1] = self.now  # which is written after this
        known: cython.float[::1] = self.known
        for i in range(self.n):
            for d in range(2):
                motion[i, d] = found[i, d] - self.rest[i, d]
                known[2 * i + d] = cython.cast(cython.float, motion[i, d])
        for i in range(0 if has_residuals else self.n):
            if not self.photometric.trusted[i]:
                row = self.start[i : i + 2]
                weighted_sums(row, self.near, self.weight, known, self.predicted[2 * i : 2 * i + 2])
                self._set_residual(found, self.residual, i)
        self.photometric.filter(self.brightness, self.sigma, self.residual, motion, self.seen)

    @cython.cfunc
    def _correlate(
        self, residual: cython.const[cython.float][::1], seen: cython.const[cython.uchar][::1]
    ) -> cython.double:
        """Autocorrelation of the residuals with the last ones, of pins seen in both; of first order."""
        last: cython.float[::1] = self.last_residual
        both: cython.double = 0
        square: cython.double = 0
        for i in range(self.n):
            if seen[i] and self.last_seen[i]:
                x = cython.cast(cython.double, last[2 * i])
                y = cython.cast(cython.double, last[2 * i + 1])
                both += x * cython.cast(cython.double, residual[2 * i])
                both += y * cython.cast(cython.double, residual[2 * i + 1])
                square += x * x + y * y
        return min(max(both / square, 0.0), 1.0) if square > 0 else 0.0

    @cython.cfunc
    def _place(
        self,
        found: cython.const[cython.double][:, ::1],
        sigma: cython.const[cython.double][::1],
    ) -> cython.Py_ssize_t:
        """Write `results`, and place the pins that are not seen where their neighbours predict them; how many
        are seen.
        """
        seen: cython.uchar[::1] = self.seen
        seen_n: cython.Py_ssize_t = 0
        for i in range(self.n):
            seen_n += seen[i]
        # Pins that are seen have no use for it.
        self.autocorrelation = self._correlate(self.residual, seen) if seen_n < self.n else 0.0
        for i in range(self.n):
            self.result_seen[i] = seen[i]
            self.result_sigma[i] = sigma[i] if seen[i] else NAN
            for d in range(2):
                self.now[i, d] = self.result_xy[i, d] = found[i, d]
                if not seen[i]:
                    left = self.autocorrelation * cython.cast(cython.double, self.last_residual[2 * i + d])
                    self.residual[2 * i + d] = cython.cast(cython.float, left)
                    self.now[i, d] = self.rest[i, d] + self.predicted[2 * i + d] + left
                    self.result_xy[i, d] = NAN
        return seen_n

    @cython.cfunc
    def _count_leapt(self) -> cython.Py_ssize_t:
        """How many pins were seen and are not, because their neighbours went too far for their windows."""
        leapt_n: cython.Py_ssize_t = 0
        for i in range(self.n):
            x = self.now[i, 0] - self.expected[i, 0]
            y = self.now[i, 1] - self.expected[i, 1]
            is_far = x * x + y * y > self.leap2 * self.pitch2[i]
            self.leapt[i] = is_far and self.last_seen[i] and not self.seen[i]
            leapt_n += self.leapt[i]
        return leapt_n

    @cython.cfunc
    def _follow_leapt(self, again: Callable[[], object], seen_n: cython.Py_ssize_t) -> cython.Py_ssize_t:
        """Read the pins that leapt where their neighbours predict them, from a group's edge inwards; how many
        pins are seen. If not all are found, none is: the blobs of those that are may be others'.
        """
        before_n: cython.Py_ssize_t = 0
        leapt = missing = np.array(self.leapt, np.bool_)
        while missing.any() and seen_n > before_n:
            np.asarray(self.expected)[missing] = np.asarray(self.now)[missing]
            again()
            before_n, seen_n = seen_n, self._evaluate()
            self._count_leapt()  # The pins that were found just now tell of more.
            leapt = leapt | np.array(self.leapt, np.bool_)
            missing = leapt & (np.asarray(self.seen) == 0)
        if missing.any():
            np.asarray(self.found)[leapt] = NAN
            seen_n = self._evaluate()
        return seen_n

    @cython.cfunc
    def _is_median_beyond(
        self, xy: cython.const[cython.double][:, ::1], limit2: cython.double
    ) -> cython.bint:
        """Whether the median distance from the predictions is above a limit; its square in pitches^2."""
        expected: cython.double[:, ::1] = self.expected
        pitch2: cython.const[cython.double][::1] = self.pitch2
        within: cython.Py_ssize_t = 0
        for i in range(self.n):
            x = xy[i, 0] - expected[i, 0]
            y = xy[i, 1] - expected[i, 1]
            within += x * x + y * y <= limit2 * pitch2[i]
        return within <= self.n // 2

    @cython.cfunc
    def _is_too_few(self, leapt: cython.bint) -> cython.bint:
        """Whether so few pins are seen, against the baseline, that the identities are given up.

        If a third vanish at once, the rest may be a lattice that slipped. A region that was lost as a whole
        does not come back by itself, but blobs do, and are refused: a search tells whose they are. And in a
        leap some pins may take their neighbours' blobs while others are lost.
        """
        vanished: cython.bint = self.share < self.baseline_share_min * self.baseline_share
        refused_n: cython.Py_ssize_t = self._count_refused() if self.share < 1.0 else 0
        # The region's border has as many again, whose neighbours are seen.
        is_back: cython.bint = 2 * (refused_n - self.doubted_n) >= (1.0 - self.full_share_min) * self.n
        self.doubted_n = min(self.doubted_n, refused_n)
        swapped: cython.bint = leapt and self.share < self.full_share_min * self.baseline_share
        return vanished or is_back or swapped

    @cython.cfunc
    def _seen_near(self, i: cython.Py_ssize_t) -> cython.int:
        """How many of the nearest of pin i were seen in the last frame."""
        near_n: cython.int = 0
        for c in range(self.closest.shape[1]):
            near_n += self.last_seen[self.closest[i, c]]
        return near_n

    @cython.cfunc
    def _count_refused(self) -> cython.Py_ssize_t:
        """How many pins are refused though a blob is there: none of their neighbours was seen."""
        refused_n: cython.Py_ssize_t = 0
        for i in range(self.n):
            if self.found[i, 0] == self.found[i, 0] and not self.seen[i]:
                refused_n += self._seen_near(i) == 0
        return refused_n

    @cython.cfunc
    def _accept(self) -> cython.void:
        """Make the frame in hand the last one."""
        now: cython.double[:, ::1] = self.now
        last: cython.double[:, ::1] = self.last
        expected: cython.double[:, ::1] = self.expected
        longest2: cython.double = HUGE_VAL if _any_missing(self.seen) else 0.0
        for i in range(self.n):
            dx = now[i, 0] - last[i, 0]
            dy = now[i, 1] - last[i, 1]
            expected[i, 0] = now[i, 0] + self.damping * dx
            expected[i, 1] = now[i, 1] + self.damping * dy
            longest2 = max(longest2, dx * dx + dy * dy)
        self.step_most = sqrt(longest2)
        self.last, self.now = self.now, self.last
        # The next frame writes what is exchanged.
        self.last_residual, self.residual = self.residual, self.last_residual
        self.last_seen, self.seen = self.seen, self.last_seen


@cython.cfunc
@cython.inline
def _any_missing(seen: cython.const[cython.uchar][::1]) -> cython.bint:
    missing: cython.uchar = 0
    for i in range(seen.shape[0]):
        missing |= seen[i] ^ 1
    return missing != 0


def _check(lattice: Lattice, n: int) -> None:
    """Raises ValueError: arrays that are not of n pins, a pin that does not exist, too many."""
    if n > PINS_MAX:
        raise ValueError(f"{n} pins; {PINS_MAX} at most are wanted")
    pairs_n = len(lattice.pairs)
    shapes = {
        "rest_xy": (lattice.rest_xy, (n, 2)),
        "local_pitch_px": (lattice.local_pitch_px, (n,)),
        "closest": (lattice.closest, (n, lattice.closest.shape[1])),
        "pairs": (lattice.pairs, (pairs_n, 2)),
        "distance_min_px": (lattice.distance_min_px, (pairs_n,)),
    }
    for name, (array, shape) in shapes.items():
        if array.shape != shape:
            raise ValueError(f"{name}: {shape} is wanted for {n} pins, not {array.shape}")
    for name, pins in (("closest", lattice.closest), ("pairs", lattice.pairs)):
        if pins.size and (pins.min() < 0 or pins.max() >= n):
            raise ValueError(f"{name}: pins of 0 to {n - 1} are wanted, not {pins.min()} to {pins.max()}")
