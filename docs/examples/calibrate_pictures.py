# %% [markdown]
# # From pictures to a calibration
#
# A notebook as a script, in jupytext's "percent" format, which Jupyter (with jupytext), VS Code and PyCharm
# open; `python docs/examples/calibrate_pictures.py [TARGETS.csv FOLDER]` runs it, and fills a new folder.
# `TARGETS.csv` names a picture and its truth in each row (docs/calibrate.md); without it, a tip is simulated.

# %%
import csv
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import matplotlib.pyplot as plt
import numpy as np

from calib.dataset import open_dataset
from calib.evaluate import predict
from calib.fit import fit
from calib.hold_out import held_out_rows
from calib.sim import Camera, Simulator, Tip, ToolPose

# %% Pictures with their truth
out = Path(tempfile.mkdtemp(prefix="calibration-", dir="."))
if len(sys.argv) == 3:
    table, folder = Path(sys.argv[1]), Path(sys.argv[2])
else:
    folder = out / "pictures"
    table = folder / "targets.csv"
    folder.mkdir()
    finger = Simulator(Camera(tip=Tip(127, "hex", pin_radius_mm=0.8), size_px=(240, 240)))
    with table.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(("sensor_image", "pose_z", "force_z"))
        for k, depth_mm in enumerate([0.0, 0.0, *np.random.default_rng(1).uniform(0.3, 3.5, 60)]):
            frame = finger.frame((ToolPose(depth_mm=depth_mm),) if depth_mm else ())
            cv2.imwrite(str(folder / f"{k}.png"), frame.image)
            rows.writerow((f"{k}.png", round(depth_mm, 4), round(sum((frame.truth or {})["forces_n"]), 4)))

# %% Features of all pictures; a fit to four fifths of them
with ThreadPoolExecutor(1) as pool:
    data = open_dataset([table], folder, None)
    extract = data.extract(pool)
    held = held_out_rows(data.targets, 0.2, seed=0)
    fitted = np.flatnonzero(~held)
    calibration, _ = fit(data.rest, data.targets.rows(fitted), extract.rows(fitted), mm_per_px=None)
calibration.save(out / "tip.json")

# %% What it reads of the others
values, sigmas = predict(calibration, extract.rows(np.flatnonzero(held)))
figure, axes = plt.subplots(1, len(values), figsize=(4 * len(values), 4), squeeze=False, layout="constrained")
for axis, (name, read) in zip(axes[0], values.items(), strict=True):
    truth = data.targets.values[name][held]
    axis.errorbar(truth, read - truth, sigmas[name], fmt="o")
    axis.set(xlabel=f"true {name}", ylabel=f"error of {name}")
    print(f"{name}: mean absolute error {np.nanmean(abs(read - truth)):.3f} on {len(truth)} pictures")
figure.savefig(out / "errors.png")
print(f"{out}: tip.json and errors.png")
