"""The files of `deploy/`: checked by systemd, by shellcheck, and against the program's options."""

import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path
from typing import Any

import lz4.block
import pytest

from edge.cli.run import run as run_command
from edge.config import Config, load_config
from hostlink.web import TOKEN_VARIABLE
from tests.conftest import ROOT
from tests.support.processes import program

DEPLOY = ROOT / "deploy"
UNIT = "voronoi-touch@.service"


def tool(name: str, package: str) -> str:
    """Path of a tool; the test is skipped where it is not installed."""
    path = shutil.which(name)
    if path is None:
        pytest.skip(f"{name} is not installed: apt-get install {package}")
    return path


def run(*command: str | Path, umask: int = -1, **environment: str) -> subprocess.CompletedProcess[str]:
    inherited = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    return program(*command, umask=umask, env={**inherited, **environment})


def runnable(name: str) -> str:
    """A unit or drop-in, with a program that exists."""
    return (DEPLOY / name).read_text().replace("/opt/voronoi-touch/current/bin/python", sys.executable)


@pytest.fixture
def unit(tmp_path: Path) -> Path:
    """The unit, and an instance of it."""
    text = runnable(UNIT)
    (tmp_path / UNIT).write_text(text)
    instance = tmp_path / UNIT.replace("@", "@index")
    instance.write_text(text)
    return instance


@pytest.mark.parametrize("drop_in", ["", "realtime.conf", "network.conf", "view.conf", "hand.conf"])
def test_the_unit_verifies_with_each_drop_in(unit: Path, drop_in: str) -> None:
    if drop_in:
        unit.write_text(f"{unit.read_text()}\n{runnable(drop_in)}")
    done = run(tool("systemd-analyze", "systemd"), "verify", "--recursive-errors=no", unit)
    assert done.returncode == 0, done.stderr
    assert "Unknown" not in done.stderr, done.stderr  # a misspelt key is only a warning


def test_the_unit_is_hardened(unit: Path) -> None:
    analyze = tool("systemd-analyze", "systemd")
    done = run(analyze, "security", "--offline=true", "--threshold=25", "--no-pager", unit)
    assert done.returncode == 0, done.stdout[-300:] + done.stderr


def options_in(name: str) -> list[str]:
    """What a unit or drop-in adds to the command line."""
    (found,) = re.findall(r'^Environment="?EDGE_OPTIONS=([^"\n]*)"?$', (DEPLOY / name).read_text(), re.M)
    return shlex.split(found)


def test_the_page_is_served_only_with_the_drop_in() -> None:
    assert options_in(UNIT) == []
    assert (DEPLOY / UNIT).read_text().count(" $EDGE_OPTIONS\n") == 1
    assert run_command.make_context("run", options_in("view.conf")).params["view_here"] is True
    reported = re.findall(r"EDGE_OPTIONS=(--[^,\n\"]*)", (DEPLOY / "view.conf").read_text())
    assert len(reported) == 3
    for options in reported:
        assert run_command.make_context("run", shlex.split(options))
        assert "--view-token" not in options, "a command line is seen by all users of the board"
    assert f"{TOKEN_VARIABLE}=" in (DEPLOY / "view.conf").read_text()


@pytest.mark.parametrize("path", sorted([*DEPLOY.glob("*.sh"), *DEPLOY.glob("sbc/*.sh")]), ids=str)
def test_shellcheck(path: Path) -> None:
    done = run(tool("shellcheck", "shellcheck"), "--severity=warning", path)
    assert done.returncode == 0, done.stdout


def test_the_example_has_every_key_and_no_other() -> None:
    """Each with its default and a comment: the example is the reference."""
    text = (DEPLOY / "edge.toml").read_text()
    config = Config()
    assert {name: set(section) for name, section in tomllib.loads(text).items()} == {
        name: set(type(getattr(config, name)).__struct_fields__) for name in Config.__struct_fields__
    }
    assert load_config(DEPLOY / "edge.toml") == config
    for line in text.splitlines():
        key = re.match(r"(\w+) = ", line)
        if key and key[1] != "demand":
            assert re.search(r" # \w+|# 0: ", line), f"no explanation: {line}"


def test_the_networkd_file_sets_the_four_that_matter() -> None:
    lines = (DEPLOY / "80-voronoi-touch-can.network").read_text().splitlines()
    assert {"BitRate=1M", "DataBitRate=5M", "FDMode=yes", "RestartSec=100ms"} <= set(lines)


def test_the_oak_manifest_has_documented_keys_only() -> None:
    manifest = tomllib.loads((DEPLOY / "oakapp.toml").read_text())
    documented = {
        "identifier", "app_version", "entrypoint", "prepare_container", "prepare_build_container",
        "build_steps", "allowed_devices", "additional_mounts",
    }  # fmt: skip
    assert manifest.keys() <= documented
    assert {"identifier", "entrypoint"} <= manifest.keys()
    assert all(step["type"] in ("COPY", "RUN") for step in manifest["prepare_container"])
    assert not manifest["identifier"].startswith(("com.luxonis", "com.example"))
    assert [mount["target"] for mount in manifest["additional_mounts"]] == ["/dev"]  # M8: UART, USB adapters


def make_wheel(folder: Path, name: str, number: str, files: dict[str, Any], more: str = "") -> None:
    info = f"{name}-{number}.dist-info"
    with zipfile.ZipFile(folder / f"{name}-{number}-py3-none-any.whl", "w") as wheel:
        for path, content in files.items():
            wheel.writestr(path, content)
        wheel.writestr(f"{info}/METADATA", f"Metadata-Version: 2.1\nName: {name}\nVersion: {number}\n{more}")
        about = "Wheel-Version: 1.0\nGenerator: t\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
        wheel.writestr(f"{info}/WHEEL", about)
        wheel.writestr(f"{info}/RECORD", "")


(LIBRARY,) = Path(lz4.block.__file__).parent.glob("_block.*.so")
PROGRAM = {
    "edge/__main__.py": "from lz4._block import compress; print(compress(b'9.9'))\n",
    f"lz4/{LIBRARY.name}": LIBRARY.read_bytes(),
}
EXTRA = "Provides-Extra: edge\n"


@pytest.fixture(scope="module")
def wheel_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A package of the same name that installs in a moment: what is tested is the installer."""
    folder = tmp_path_factory.mktemp("wheels")
    make_wheel(folder, "voronoi_touch", "9.9", PROGRAM, EXTRA)
    return folder


class Board:
    """A file tree to install into."""

    def __init__(self, root: Path, wheels: Path) -> None:
        self.root, self.wheels = root, wheels
        root.mkdir()

    def install(self, *options: str, umask: int = 0o022) -> None:
        place = ("--root", self.root, "--wheels", self.wheels)
        done = run("sh", DEPLOY / "install.sh", *place, *options, umask=umask)
        assert done.returncode == 0, done.stderr + done.stdout

    @property
    def current(self) -> str:
        return os.readlink(self.root / "opt/voronoi-touch/current")

    def kept(self) -> dict[str, str]:
        """Configuration and state, by name."""
        folders = (self.root / "etc/voronoi-touch", self.root / "var/lib/voronoi-touch")
        return {str(p): p.read_text() for folder in folders for p in folder.rglob("*") if p.is_file()}

    def check_modes(self) -> None:
        """A release is readable by the service and all users, and writable by its owner alone."""
        paths = [path for path in self.root.rglob("*") if not path.is_symlink()]
        assert {"pyvenv.cfg", "edge", "__main__.py"} <= {path.name for path in paths}
        for path in paths:
            mode = path.stat().st_mode
            assert mode & 0o022 == 0, f"{path} may be written by others"
            assert mode & 0o044 == 0o044, f"{path} cannot be read by the service"
            assert not path.is_dir() or mode & 0o011 == 0o011, f"{path} cannot be entered by the service"


def test_install_upgrade_rollback_uninstall(tmp_path: Path, wheel_dir: Path) -> None:
    """With any umask of root; a release that does not run is not used."""
    board = Board(tmp_path / "root", wheel_dir)
    board.install("--finger", "index", "--node", "7", "--extras", "view", umask=0)
    board.check_modes()
    (library,) = (board.root / "opt").rglob(LIBRARY.name)  # which runs without debug information
    assert library.stat().st_size < LIBRARY.stat().st_size
    config = load_config(board.root / "etc/voronoi-touch/index.toml")
    assert (config.sensor.serial, config.sensor.node_id, config.link.sinks) == ("index", 7, ("can:can0",))
    assert config.state.directory == "/var/lib/voronoi-touch/index"
    first = board.current
    settings = board.root / "var/lib/voronoi-touch/index/settings.json"
    settings.parent.mkdir()
    settings.write_text('{"rate_hz": 7.0}')
    (board.root / "etc/voronoi-touch/index.toml").write_text("[sensor]\nnode_id = 9\n")
    kept = board.kept()

    board.install("--finger", "index", "--extras", "oak", umask=0o027)  # again: nothing is overwritten
    assert (board.root / board.current[1:] / "extras").read_text() == "edge,view,oak\n"
    board.check_modes()
    second = board.current
    assert (second != first, board.kept()) == (True, kept)
    for expected in (first, second):
        board.install("--rollback")
        assert board.current == expected
    assert board.kept() == kept
    board.install(umask=0o077)
    board.check_modes()
    assert len(list((board.root / "opt/voronoi-touch/releases").iterdir())) == 2

    good, broken = board.current, tmp_path / "broken"
    broken.mkdir()
    make_wheel(broken, "voronoi_touch", "9.9", PROGRAM | {"edge/__main__.py": "raise SystemExit(1)"}, EXTRA)
    done = run("sh", DEPLOY / "install.sh", "--root", board.root, "--wheels", broken)
    assert (done.returncode, "does not run" in done.stderr, board.current) == (2, True, good)
    assert len(list((board.root / "opt/voronoi-touch/releases").iterdir())) == 2

    board.install("--uninstall")
    assert not any((board.root / p).exists() for p in ("opt/voronoi-touch", f"etc/systemd/system/{UNIT}"))
    assert board.kept() == kept
    board.install("--uninstall", "--purge")
    assert board.kept() == {}


#: A build backend that leaves a folder behind, as setuptools does.
BACKEND = """
import pathlib, shutil, sys

def get_requires_for_build_wheel(config_settings=None):
    return []

def build_wheel(directory, config_settings=None, metadata_directory=None):
    pathlib.Path("build").mkdir()
    (wheel,) = pathlib.Path("made").glob("*.whl")
    shutil.copy(wheel, directory)
    return wheel.name
"""


def test_a_checkout_is_unchanged_and_its_constraints_hold(tmp_path: Path) -> None:
    checkout, index = tmp_path / "checkout", tmp_path / "index"
    (checkout / "made").mkdir(parents=True)
    index.mkdir()
    # An emulated board's file system in the cache has devices, which a copy would read without end.
    shutil.copytree(DEPLOY, checkout / "deploy", ignore=shutil.ignore_patterns(".cache"))
    needs = EXTRA + 'Requires-Dist: helper; extra == "edge"\n'
    make_wheel(checkout / "made", "voronoi_touch", "9.9", PROGRAM, needs)
    for number in ("1.0", "2.0"):
        make_wheel(index, "helper", number, {"helper.py": ""})
    (checkout / "constraints.txt").write_text("helper==1.0\n")
    (checkout / "backend.py").write_text(BACKEND)
    (checkout / "pyproject.toml").write_text(
        '[build-system]\nrequires = []\nbuild-backend = "backend"\nbackend-path = ["."]\n'
        '[project]\nname = "voronoi-touch"\nversion = "9.9"\n'
    )
    before = {path: path.stat().st_mtime_ns for path in checkout.rglob("*")}
    root = tmp_path / "root"
    root.mkdir()
    done = run(
        "sh", checkout / "deploy/install.sh", "--root", root,
        PIP_NO_INDEX="1", PIP_FIND_LINKS=str(index), TMPDIR=str(tmp_path),
    )  # fmt: skip
    assert done.returncode == 0, done.stderr + done.stdout
    assert {path: path.stat().st_mtime_ns for path in checkout.rglob("*")} == before
    packages = {path.name for path in root.rglob("*.dist-info")}
    assert {"helper-1.0.dist-info", "voronoi_touch-9.9.dist-info"} <= packages
    assert sorted(path.name for path in tmp_path.iterdir()) == ["checkout", "index", "root"]


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("install.sh --node 128", "1 to 127"),
        ("install.sh --node 007", "1 to 127"),
        ("install.sh --finger ../x", "a-z"),
        ("install.sh --colour", "unknown option"),
        ("install.sh --node", "needs a value"),
        ("install.sh --root /no/such", "--root /no/such: no such folder"),
        ("install.sh --wheels /no/such", "--wheels /no/such: no such folder"),
        ("can-up.sh can77", "no interface can77; CAN interfaces here: "),
        ("can-up.sh can77 fast", "BITRATE fast"),
        ("can-up.sh --up", "unknown option --up; see --help"),
    ],
)
def test_mistakes_are_one_line(command: str, message: str) -> None:
    script, *arguments = command.split()
    done = run("sh", DEPLOY / script, *arguments)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert message in line


@pytest.mark.parametrize("script", ["install.sh", "can-up.sh"])
def test_help_is_the_head_of_the_script(script: str) -> None:
    done = run("sh", DEPLOY / script, "--help")
    assert done.returncode == 0
    assert script in done.stdout
    assert "set -eu" not in done.stdout
    if script == "install.sh":  # no index has the package
        assert "pip wheel -w DIR -c constraints.txt '.[edge]'" in done.stdout


@pytest.mark.slow
def test_the_wheels_resolve_for_arm64(tmp_path: Path) -> None:
    """For Python 3.11, from wheels alone: nothing is compiled on the board. Prints the size there."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    wanted = [*project["dependencies"], *project["optional-dependencies"]["edge"]]
    platforms = [f"manylinux_2_{n}_aarch64" for n in (28, 27, 17)] + ["manylinux2014_aarch64"]
    done = run(
        sys.executable, "-m", "pip", "download", "-q", "--disable-pip-version-check", "-d", tmp_path,
        "--only-binary=:all:", "--python-version", "3.11", "--implementation", "cp",
        *(o for abi in ("cp311", "abi3", "none") for o in ("--abi", abi)),
        *(o for p in platforms for o in ("--platform", p)), *wanted,
    )  # fmt: skip
    if done.returncode and re.search(r"onnection|resolution|timed out|Max retries", done.stderr):
        pytest.skip("no package index can be reached")
    assert done.returncode == 0, done.stderr[-500:]
    sizes = {
        path.name.split("-")[0]: sum(entry.file_size for entry in zipfile.ZipFile(path).infolist()) / 1e6
        for path in tmp_path.glob("*.whl")
    }
    total_mb = sum(sizes.values())
    print(f"\non the board: {total_mb:.0f} MB, of them", {k: round(v) for k, v in sizes.items() if v > 5})
    assert "depthai" not in sizes
    assert total_mb < 250
