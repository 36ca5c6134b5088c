"""What the page's charts show of every sample, in this order; the page finds it by name."""

from hostlink.wire import FIELDS
from hostlink.wire.shown import live_fields

#: Fields of the sample that are shown as they are sent.
CHARTED = live_fields(FIELDS)
CHART = ("time_s", *CHARTED, "latency_ms", "volume_px2", "shear_x_px", "shear_y_px")
