"""A wheel of this project for arm64, made on any machine: `python deploy/sbc/cross_wheel.py FOLDER`.

The kernels use the limited API, whose headers do not depend on the processor: the cross compiler (Debian:
gcc-aarch64-linux-gnu) takes this machine's.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
COMPILER = "aarch64-linux-gnu-gcc"


def main(target: Path) -> Path:
    """Write the wheel into a folder."""
    target = target.resolve()
    target.mkdir(parents=True, exist_ok=True)
    for old in target.glob("voronoi_touch-*.whl"):
        old.unlink()
    settings = {"CC": COMPILER, "LDSHARED": f"{COMPILER} -shared", "_PYTHON_HOST_PLATFORM": "linux-aarch64"}
    build = ROOT / "build" / "aarch64"
    shutil.rmtree(build, ignore_errors=True)  # setuptools would take what has left the source
    command = [sys.executable, "setup.py", "--quiet", "build", "--build-base", str(build)]
    command += ["bdist_wheel", "--bdist-dir", str(build / "wheel"), "--dist-dir", str(target)]
    subprocess.run(command, cwd=ROOT, env=os.environ | settings, check=True)
    return next(target.glob("voronoi_touch-*-linux_aarch64.whl"))


if __name__ == "__main__":
    print(main(Path(sys.argv[1])))
