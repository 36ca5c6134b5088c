"""A wheel of this project for arm64, made on any machine: `python deploy/sbc/cross_wheel.py FOLDER`.

The extensions use the limited API, whose headers do not depend on the processor: compiled by the cross
compiler (Debian: gcc-aarch64-linux-gnu) they replace this machine's in the wheel that setuptools has made.
"""

from __future__ import annotations

import base64
import hashlib
import subprocess
import sys
import sysconfig
import tomllib
import zipfile
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parents[2]
COMPILER = "aarch64-linux-gnu-gcc"
TAG = "cp311-abi3-linux_aarch64"


def compile_extensions(folder: Path) -> dict[str, bytes]:
    """Path within the wheel -> bytes of each extension of pyproject.toml."""
    table = tomllib.loads((ROOT / "pyproject.toml").read_text())
    made = {}
    for module in table["tool"]["setuptools"]["ext-modules"]:
        out = folder / (module["name"] + ".so")
        defines = [f"-D{name}={value}" for name, value in module.get("define-macros", [])]
        include = f"-I{sysconfig.get_path('include')}"
        command = [COMPILER, "-shared", "-fPIC", "-DNDEBUG", include, *defines, *module["extra-compile-args"]]
        subprocess.run([*command, *module["sources"], "-lm", "-o", str(out)], cwd=ROOT, check=True)
        made[module["name"].replace(".", "/") + ".abi3.so"] = out.read_bytes()
    return made


def main(target: Path) -> Path:
    """Write the wheel into a folder."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        subprocess.run(
            [
                *(sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps"),
                *("--no-build-isolation", "-w", name, "."),
            ],
            cwd=ROOT,
            check=True,
        )  # fmt: skip
        source = next(folder.glob("*.whl"))
        foreign = compile_extensions(folder)
        target.mkdir(parents=True, exist_ok=True)
        for old in target.glob("voronoi_touch-*.whl"):
            old.unlink()
        wheel = target / f"{'-'.join(source.name.split('-')[:2])}-{TAG}.whl"
        record: list[str] = []
        with zipfile.ZipFile(source) as old, zipfile.ZipFile(wheel, "w", zipfile.ZIP_DEFLATED) as new:
            info = next(n for n in old.namelist() if n.endswith(".dist-info/RECORD"))
            for entry in old.namelist():
                data = foreign.get(entry, old.read(entry))
                if entry.endswith(".dist-info/WHEEL"):
                    lines = [line for line in data.decode().splitlines() if not line.startswith("Tag:")]
                    data = "\n".join([*lines, f"Tag: {TAG}", ""]).encode()
                if entry == info or entry.endswith("/"):
                    continue
                digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
                record.append(f"{entry},sha256={digest},{len(data)}")
                new.writestr(entry, data)
            new.writestr(info, "\n".join([*record, f"{info},,", ""]))
    return wheel


if __name__ == "__main__":
    print(main(Path(sys.argv[1])))
