"""The wheel is one for all releases of CPython, and runs where there is neither compiler nor Cython."""

import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest

from tests.support.kernels import ROOT, table
from tests.support.processes import program
from tests.test_commands_shown import PAGES, commands

VERSION = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
#: Imports the pipeline from the wheel without Cython, and calls a kernel.
PROGRAM = """
import sys
sys.modules["cython"] = sys.modules["Cython"] = None  # an import of it fails
import numpy as np
import edge.frame
from edge.cells.mesh import Mesh
areas = np.empty(1)
Mesh(1, 4).update(np.array([[0, 0], [1, 1], [-1, 1], [-1, -1], [1, -1.0]]), areas)
print(edge.frame.__file__, float(areas[0]))
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    for old in (ROOT / "build").glob("lib*"):  # with files that were removed from the source
        shutil.rmtree(old)
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps"]
    subprocess.run([*command, "-w", str(folder), "."], cwd=ROOT, check=True, timeout=900)
    (made,) = folder.glob("*.whl")
    return made


@pytest.mark.parametrize(
    ("file", "line"),
    [
        ("CITATION.cff", "version: {}"),
        ("deploy/oakapp.toml", 'app_version = "{}"'),
        ("hostlink/bridge/voronoi_touch_msgs/package.xml", "  <version>{}</version>"),
    ],
)
def test_the_version_is_the_same_wherever_it_stands(file: str, line: str) -> None:
    assert line.format(VERSION) in (ROOT / file).read_text().splitlines()


def test_the_changelog_has_this_version() -> None:
    assert f"\n## {VERSION} - " in (ROOT / "CHANGELOG.md").read_text()


def test_every_kernel_is_in_it_for_every_release(wheel: Path) -> None:
    platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    assert wheel.name.endswith(f"-cp311-abi3-{platform}.whl")
    names = zipfile.ZipFile(wheel).namelist()
    kernels = {f"{name.replace('.', '/')}.abi3.so" for name in (*table().KERNELS, table().SHARED)}
    assert {name for name in names if name.endswith(".so")} == kernels
    sensors = {path.relative_to(ROOT).as_posix() for path in (ROOT / "edge" / "sensors").glob("*.toml")}
    assert sensors
    assert sensors <= set(names)
    assert {"edge/examples/press.mcap", "edge/examples/press.json", "edge/examples/sim.json"} <= set(names)
    (about,) = (name for name in names if name.endswith(".dist-info/METADATA"))
    text = zipfile.ZipFile(wheel).read(about).decode()
    assert "# voronoi-touch\n" in text
    assert not re.findall(r"\]\((?!https?://)", text), "links that lead nowhere from a package index"
    made = [name for name in names if name.startswith("edge/") and name.endswith((".c", ".h"))]
    assert not [name for name in made if not (ROOT / name).is_file()]  # what Cython makes stays out


def test_the_wheel_runs_without_a_compiler(wheel: Path, tmp_path: Path) -> None:
    venv.create(tmp_path / "env", symlinks=True)
    python = tmp_path / "env" / "bin" / "python"
    pure = ("-c", "import sysconfig; print(sysconfig.get_path('purelib'))")
    packages = Path(subprocess.check_output([python, *pure], text=True).strip())
    pip = python.with_name("pip")
    pip.write_text(f'#!/bin/sh\nexec {sys.executable} -m pip --python {python} "$@"\n')
    pip.chmod(0o755)
    environment = {"PATH": f"{python.parent}:/usr/bin:/bin", "CC": "false", "HOME": str(tmp_path)}
    index = {"PIP_NO_INDEX": "1", "PIP_NO_DEPS": "1", "PIP_FIND_LINKS": str(wheel.parent)}
    shown = {command for page in PAGES for block in commands(page) for command in block}
    for command in sorted(c for c in shown if c.startswith("pip install") and "voronoi-touch" in c):
        done = program("bash", "-c", command, cwd=tmp_path, env=os.environ | environment | index)
        assert (done.returncode, "does not provide" in done.stderr) == (0, False), done.stderr
    # Dependencies come from these folders; the project itself is not in them.
    own = [p for p in sys.path if p.endswith(("site-packages", "dist-packages"))]
    (packages / "dependencies.pth").write_text("\n".join(own) + "\n")
    output = subprocess.check_output([python, "-c", PROGRAM], cwd=tmp_path, env=environment, text=True)
    file, area = output.split()
    assert Path(file).is_relative_to(packages)
    assert float(area) == 2.0
    started = [str(python.parent / "voronoi-touch-edge"), "--version"]
    version = subprocess.check_output(started, cwd=tmp_path, env=environment, text=True)
    assert version.split()[-1] == VERSION
    first = next(command for block in commands("README.md") for command in block if "example:" in command)
    assert "largest depth, mm" in program("bash", "-c", first, cwd=tmp_path, env=environment).stdout


@pytest.mark.slow
def test_the_source_archive_makes_the_same_wheel(wheel: Path, tmp_path: Path) -> None:
    """All that is needed is in it: kernels' declarations, pages, C files, messages."""
    archive = f"from setuptools import build_meta; build_meta.build_sdist({str(tmp_path)!r})"
    subprocess.run([sys.executable, "-c", archive], cwd=ROOT, check=True, capture_output=True, timeout=300)
    (made,) = tmp_path.glob("*.tar.gz")
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "-w", str(tmp_path / "wheel")]
    subprocess.run([*command, str(made)], cwd=tmp_path, check=True, timeout=900)
    (again,) = (tmp_path / "wheel").glob("*.whl")
    assert again.name == wheel.name
    assert sorted(zipfile.ZipFile(again).namelist()) == sorted(zipfile.ZipFile(wheel).namelist())
    with tarfile.open(made) as source:
        names = {name.partition("/")[2] for name in source.getnames()}
    assert {"LICENSE", "CITATION.cff", "CHANGELOG.md", "constraints.txt"} <= names
    assert {"deploy/install.sh", "tests/conftest.py", "docs/examples/read_a_finger.py"} <= names
