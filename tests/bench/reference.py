"""The paper's method implemented directly with common libraries: the oracle and the baseline of every ratio.

    image -> cv2.SimpleBlobDetector -> nearest rest pin -> scipy.spatial.Voronoi with artificial points
          -> scipy griddata cubic on a grid -> skimage.morphology.local_maxima, volume, mean shear

Rules
- Straightforward, but not handicapped: detector parameters suit the tip, nothing is computed twice, boundary
  and rest areas are made once. One thread.
- Identities by nearest rest pin while the motion since the last frame is below half a pitch, like the
  tracking in the paper; it does not survive a jump.
Source  Cramphorn, Lloyd, Lepora 2018, section "Methods".
"""

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.interpolate import griddata
from scipy.spatial import ConvexHull, Voronoi, cKDTree
from skimage.morphology import local_maxima

from edge.types import Array, Image, Mask

GRID = 64
#: Maxima below this relative area change do not count as contacts.
THRESHOLD = 0.05


@dataclass(frozen=True)
class Result:
    """The paper's results for one frame.

    xy_img       (n, 2) px, row i is rest pin i; NaN where the detector missed it
    area_px2     (n,) bounded Voronoi cells
    surface      (g, g) relative area change, NaN outside of the pins
    volume_px2   integral of the compressed part
    contacts_img (k, 2) px, regional maxima above the threshold, highest first
    shear_px     (2,) mean motion of the pins
    """

    xy_img: Array
    area_px2: Array
    surface: Array
    volume_px2: float
    contacts_img: Array
    shear_px: Array


def make_detector(pin_radius_px: float) -> cv2.SimpleBlobDetector:
    """A detector of bright round blobs of about this radius."""
    p = cv2.SimpleBlobDetector.Params()
    p.filterByColor, p.blobColor = True, 255
    area = np.pi * pin_radius_px**2
    p.filterByArea, p.minArea, p.maxArea = True, 0.2 * area, 4.0 * area
    p.filterByCircularity, p.minCircularity = True, 0.5
    p.filterByConvexity, p.minConvexity = True, 0.7
    p.filterByInertia, p.minInertiaRatio = True, 0.3
    p.minThreshold, p.maxThreshold, p.thresholdStep = 40.0, 220.0, 20.0
    p.minRepeatability = 2
    p.minDistBetweenBlobs = pin_radius_px
    return cv2.SimpleBlobDetector.create(p)


def find_pins(detector: cv2.SimpleBlobDetector, image: Image) -> Array:
    """(n, 2) px, centres of the blobs, unordered."""
    return np.array([k.pt for k in detector.detect(image)], dtype=np.float64).reshape(-1, 2)


def boundary(xy: Array, pitch_px: float) -> Array:
    """Artificial points on the pins' hull moved out by one pitch, twice as dense as the pins."""
    hull = xy[ConvexHull(xy).vertices]
    centre = hull.mean(axis=0)
    out = hull - centre
    out = centre + out * (1.0 + pitch_px / np.hypot(*out.T))[:, None]
    ends = np.roll(out, -1, axis=0)
    points = []
    for a, b in zip(out, ends, strict=True):
        k = max(1, round(float(np.hypot(*(b - a))) / (0.5 * pitch_px)))
        points.append(a + (b - a) * (np.arange(k) / k)[:, None])
    return np.concatenate(points)


def cell_areas(xy: Array, edge: Array) -> Array:
    """Areas of the Voronoi cells of xy among xy and the artificial points; NaN where a cell is unbounded."""
    voronoi = Voronoi(np.vstack([xy, edge]))
    area = np.full(len(xy), np.nan)
    for i in range(len(xy)):
        region = voronoi.regions[voronoi.point_region[i]]
        if not region or -1 in region:
            continue
        corner = voronoi.vertices[region]  # in order round the cell in two dimensions
        x, y = corner[:, 0], corner[:, 1]
        area[i] = 0.5 * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1))
    return area


class Reference:
    """The paper's method on one tip.

    rest          (h, w) uint8, the untouched tip
    pin_radius_px of a pin's disc
    rest_img      (n, 2) px: the pins; None: those that the detector finds on `rest`
    """

    def __init__(self, rest: Image, pin_radius_px: float, *, rest_img: Array | None = None) -> None:
        self.detector = make_detector(pin_radius_px)
        self.rest_img = find_pins(self.detector, rest) if rest_img is None else rest_img
        near, _ = cKDTree(self.rest_img).query(self.rest_img, k=4)
        self.pitch_px = float(np.median(near[:, 1:]))
        self.edge = boundary(self.rest_img, self.pitch_px)
        self.rest_area_px2 = cell_areas(self.rest_img, self.edge)
        low, high = self.rest_img.min(axis=0), self.rest_img.max(axis=0)
        self.grid_img = np.linspace(low[0], high[0], GRID), np.linspace(low[1], high[1], GRID)
        self._mesh = np.meshgrid(*self.grid_img)
        self._cell_px2 = float(np.prod((high - low) / (GRID - 1)))
        self._last = self.rest_img

    def place(self, xy: Array) -> None:
        """Where the pins are before the next image (NaN: as before): the method cannot follow a jump."""
        self._last = np.where(np.isfinite(xy), xy, self._last)

    def step(self, image: Image) -> Result:
        """All results from one image."""
        return self.features(self.follow(find_pins(self.detector, image)))

    def follow(self, blobs: Array) -> Array:
        """Blobs in the order of the rest pins, by nearest neighbour to the last frame."""
        out = np.full_like(self.rest_img, np.nan)
        if len(blobs):
            far, index = cKDTree(blobs).query(self._last, distance_upper_bound=0.5 * self.pitch_px)
            found: Mask = np.isfinite(far)
            out[found] = blobs[index[found]]
            self._last = np.where(found[:, None], out, self._last)
        return out

    def features(self, xy: Array) -> Result:
        """Cells, surface, volume, contacts and shear of pins at xy (NaN: lost)."""
        seen = np.isfinite(xy[:, 0])
        area = np.full(len(xy), np.nan)
        area[seen] = cell_areas(xy[seen], self.edge)
        change = area / self.rest_area_px2 - 1.0
        use = seen & np.isfinite(change)
        surface = griddata(xy[use], change[use], (self._mesh[0], self._mesh[1]), method="cubic")
        height = np.where(np.isfinite(surface), surface, -np.inf)
        volume = float(np.maximum(height, 0.0).sum()) * self._cell_px2
        rows, cols = np.nonzero(local_maxima(height) & (height > THRESHOLD))
        order = np.argsort(-height[rows, cols], kind="stable")
        contacts = np.column_stack([self.grid_img[0][cols], self.grid_img[1][rows]])[order]
        return Result(xy, area, surface, volume, contacts, np.nanmean(xy - self.rest_img, axis=0))
