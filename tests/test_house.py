"""Allowed imports between packages, and modules that a process must not load."""

import ast
import re
import sys
import tomllib
from functools import cache
from pathlib import Path

import pytest

from tests.support import kernels
from tests.support.changed import ALWAYS, paths_for
from tests.support.processes import python

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("edge", "hostlink", "calib", "tests")
STDLIB = frozenset(sys.stdlib_module_names)

#: Modules of hostlink that the edge uses too: the bus, clocks, command lines, files, Foxglove's topics.
SHARED_WITH_EDGE = (
    "hostlink.can_bus", "hostlink.cli_exit", "hostlink.cli_types", "hostlink.order_and_time",
    "hostlink.command_group", "hostlink.input_file", "hostlink.interrupt", "hostlink.link_guard",
    "hostlink.mcap_chunk", "hostlink.output_file", "hostlink.topics",
)  # fmt: skip
#: A package may import only these of the project's own packages.
MAY_IMPORT = {
    "hostlink/wire": ("hostlink.wire",),
    "hostlink/web": ("hostlink.web", "hostlink.input_file"),
    "hostlink": ("hostlink",),
    "edge": ("edge", "hostlink.wire", "hostlink.web", *SHARED_WITH_EDGE),
    "calib": ("calib", "edge", "hostlink"),
}
#: Modules of a stage, and of geometry, know `types`, `errors`, `limits`, `params` and the mathematics in
#: `geometry`, never another stage.
STAGES = ("sources", "pins", "tracking", "cells", "features", "calibration")
SHARED = ("edge.types", "edge.errors", "edge.limits", "edge.params", "edge.geometry")

#: The rooms of edge from the bottom up, as a frame passes them; a room imports from those below it alone.
ROOMS = (
    "errors", "params", "limits", "types", "geometry", "sensors", "examples", "sources", "config", "pins",
    "tracking", "cells", "features", "calibration", "drift", "faults", "views", "frame", "rest", "fingertip",
    "view", "recording", "link", "runtime", "worker", "cli", "__main__",
)  # fmt: skip


@cache
def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def imports(path: Path) -> set[str]:
    """Full names of the modules that a file imports, at any depth of its code."""
    names: set[str] = set()
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import; write the full name"
            if node.module in PACKAGES:
                names.update(f"{node.module}.{alias.name}" for alias in node.names)
            elif node.module:
                names.add(node.module)
    return names


LINES_MAX, PARAMETERS_MAX = 60, 8  # of functions, of constructors


def functions(path: Path) -> list[ast.FunctionDef | ast.AsyncFunctionDef]:
    nodes = ast.walk(tree(path))
    return [node for node in nodes if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]


def package_of(path: Path) -> str:
    relative = path.relative_to(ROOT).as_posix()
    return next(package for package in MAY_IMPORT if relative.startswith(package + "/"))


SOURCES = sorted(path for package in ("edge", "hostlink", "calib") for path in (ROOT / package).rglob("*.py"))


def test_packages_import_only_what_they_may() -> None:
    for path in SOURCES:
        allowed = MAY_IMPORT[package_of(path)]
        for name in imports(path):
            known = any(name == a or name.startswith(a + ".") for a in allowed)
            assert known or name.split(".")[0] not in PACKAGES, f"{path} imports {name}"


def test_no_function_is_long() -> None:
    long = [
        f"{path.relative_to(ROOT).as_posix()}:{f.name}"
        for path in [*SOURCES, *sorted((ROOT / "tests").rglob("*.py"))]
        for f in functions(path)
        if f.end_lineno and f.end_lineno - f.lineno >= LINES_MAX
    ]
    assert not long, f"more than {LINES_MAX} lines"


def test_no_constructor_takes_many_parameters() -> None:
    many = [
        path.relative_to(ROOT).as_posix()
        for path in SOURCES
        for f in functions(path)
        if f.name == "__init__" and len(f.args.args) - 1 + len(f.args.kwonlyargs) > PARAMETERS_MAX
    ]
    assert not many, "group what belongs together in a dataclass"


def test_class_names_are_distinct() -> None:
    """A name means one thing in the whole project."""
    places: dict[str, list[str]] = {}
    for path in SOURCES:
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.ClassDef):
                places.setdefault(node.name, []).append(path.relative_to(ROOT).as_posix())
    assert not {name: where for name, where in places.items() if len(where) > 1}


def room_of(module: str) -> str:
    return module.split(".")[1]


def test_imports_within_edge_go_down_only() -> None:
    up = []
    for path in sorted((ROOT / "edge").rglob("*.py")):
        own = room_of(".".join(path.relative_to(ROOT).with_suffix("").parts))
        names = {name for name in imports(path) if name.startswith("edge.") and room_of(name) != own}
        if own != "__init__":
            up += [f"{path} imports {n}" for n in names if ROOMS.index(room_of(n)) > ROOMS.index(own)]
    assert not up


@pytest.mark.parametrize("stage", [*STAGES, "geometry"])
def test_stages_know_only_the_types(stage: str) -> None:
    files = sorted((ROOT / "edge" / stage).glob("*.py"))
    assert files, f"no stage {stage}"
    for path in files:
        for name in imports(path):
            known = any(name == s or name.startswith(s + ".") for s in (*SHARED, f"edge.{stage}"))
            assert known or not name.startswith("edge."), f"{path} imports {name}: {', '.join(SHARED)} alone"


def test_each_stage_can_be_imported_first() -> None:
    """Imports must work in any order."""
    for stage in (*STAGES, "geometry.motion_field", "geometry.lattice"):
        python("-c", f"import edge.{stage}", check=True, cwd=ROOT)


def test_the_wire_is_standard_library_only() -> None:
    for path in (ROOT / "hostlink" / "wire").glob("*.py"):
        for name in imports(path):
            own = name == "hostlink.wire" or name.startswith("hostlink.wire.")
            assert own or name.split(".")[0] in STDLIB, f"{path}: {name}"


def loaded_by(statement: str) -> set[str]:
    """Top-level modules in a fresh interpreter after a statement."""
    code = f"{statement}\nimport sys; print(' '.join(sorted({{m.split('.')[0] for m in sys.modules}})))"
    return set(python("-c", code, check=True, cwd=ROOT).stdout.split())


def test_the_edge_loads_no_heavy_libraries() -> None:
    loaded = loaded_by("import edge.frame, edge.view.panels")
    assert not loaded & {"matplotlib", "skimage", "depthai", "aiohttp", "mcap", "pandas"}


def test_the_finger_needs_no_scipy() -> None:
    """A board does not install it: it would be a third of the disk, of the memory and of the start."""
    named = [
        f for f in (ROOT / "edge").rglob("*.py") if re.search(r"^\s*(from|import) scipy", f.read_text(), re.M)
    ]
    assert named == []


@pytest.mark.parametrize(
    ("sink", "unneeded"),
    [
        ("memory:", {"scipy", "skimage", "matplotlib"}),  # a third of the memory and of the start
        ("serial:loop://", {"can", "canopen", "asyncio", "ssl"}),  # 14 MB, and a tenth of the start
    ],
)
def test_the_running_finger_loads_nothing_that_it_does_not_use(sink: str, unneeded: set[str]) -> None:
    play = (
        f"words = 'edge replay tests/data/two_contacts.mcap -q --speed max --sink {sink}'\n"
        "import sys; sys.argv = words.split()\n"
        "from edge.cli.program import cli\ncli(standalone_mode=False)\n"
        f"import edge.{'worker.client' if sink == 'memory:' else 'link.socketcan'}, edge.cli.run"
    )
    assert not loaded_by(play) & unneeded


def test_coverage_leaves_out_the_kernels_and_nothing_else() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["coverage"][
        "report"
    ]
    assert settings["omit"] == [f"{name.replace('.', '/')}.py" for name in kernels.table().KERNELS]


@pytest.mark.parametrize(
    ("file", "tests"),
    [
        ("edge/cells/mesh.py", "tests/edge/cells"),
        ("calib/sim/tip.py", "tests/calib"),
        ("calib/fit.py", "tests/calib/test_fit.py"),
        ("tests/edge/cells/test_mesh.py", "tests/edge/cells"),
        ("tests/test_wheel.py", "tests/test_wheel.py"),
        ("docs/numbers.md", "tests/test_docs.py"),
    ],
)
def test_a_change_asks_for_the_tests_beside_it(file: str, tests: str) -> None:
    found = paths_for([file])
    assert tests in found
    assert set(found) - {tests} <= set(ALWAYS)
