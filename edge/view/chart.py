"""What the page's charts show of every sample, in this order; the page finds it by name."""

#: Fields of the sample that are shown as they are sent.
CHARTED = (
    "displacement_mm", "shear_x_mm", "shear_y_mm", "torsion_deg", "force_n", "force_x_n", "force_y_n",
    "slip_margin",
)  # fmt: skip
CHART = ("time_s", *CHARTED, "latency_ms", "volume_px2", "shear_x_px", "shear_y_px")
