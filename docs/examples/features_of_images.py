"""Image in, features out, in Python alone: no bus, no link.

    python docs/examples/features_of_images.py [SOURCE [CALIBRATION]]

SOURCE is a camera (v4l2:0), a recording, a video or a folder. Leave the tip untouched at first.
"""

import sys
from collections.abc import Iterator
from itertools import islice

from edge import Fingertip, open_source


def readings(address: str, calibration: str | None) -> Iterator[tuple[float, float, float, int]]:
    """Time s, depth mm, mean motion of the pins px, number of contacts, of each image."""
    source = open_source(address)
    frames = iter(source)
    tip = Fingertip([frame.image for frame in islice(frames, 8)], calibration)
    for frame in frames:
        time_s = frame.capture_ns / 1e9
        touch = tip.read(frame.image, time_s)
        if touch.features is None or touch.features.shear_px is None:
            continue  # the pins could not be identified in this image
        depth_mm = touch.reading.values.get("displacement_mm", float("nan"))
        x_px, y_px = touch.features.shear_px
        yield time_s, depth_mm, float((x_px**2 + y_px**2) ** 0.5), len(touch.features.contacts or ())
    source.close()


def main(address: str = "example:press", calibration: str | None = None) -> None:
    if address == "example:press":
        calibration = address
    for time_s, depth_mm, moved_px, contacts in readings(address, calibration):
        print(f"{time_s:6.2f} s  depth {depth_mm:5.2f} mm  moved {moved_px:5.2f} px  {contacts} contacts")


if __name__ == "__main__":
    main(*sys.argv[1:])
