"""Which build of the kernels the tests run: $VORONOI_TOUCH_KERNELS.

release      built by pip beside the sources; the default
checked      build/checked, sanitized build/sanitized: made by `python setup.py build_ext --variant NAME`
python       uncompiled
"""

import importlib.util
import os
import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ExtensionFileLoader, ModuleSpec, SourceFileLoader
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).resolve().parents[2]
VARIABLE = "VORONOI_TOUCH_KERNELS"


def table() -> ModuleType:
    """setup.py as a module: its KERNELS, SHARED and VARIANTS."""
    spec = importlib.util.spec_from_file_location("voronoi_touch_setup", ROOT / "setup.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


class KernelFinder(MetaPathFinder):
    """Finds the kernels in one build, before Python looks beside the sources."""

    def __init__(self, variant: str) -> None:
        setup = table()
        if variant != "python" and variant not in setup.VARIANTS:
            raise ValueError(f"${VARIABLE}={variant}: choose one of {', '.join(setup.VARIANTS)}, python")
        self.variant = variant
        self.kernels = frozenset(setup.KERNELS)
        self.compiled = self.kernels | {setup.SHARED}

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if name not in self.compiled:
            return None
        loader: SourceFileLoader | ExtensionFileLoader
        source = ROOT.joinpath(*name.split(".")).with_suffix(".py")
        if self.variant == "python":
            if name not in self.kernels:
                return None
            loader = SourceFileLoader(name, str(source))
        else:
            loader = ExtensionFileLoader(name, str(self._compiled(name, source)))
        return importlib.util.spec_from_file_location(name, loader.path, loader=loader)

    def _compiled(self, name: str, source: Path) -> Path:
        """The compiled module, not older than its source."""
        folder = ROOT if self.variant == "release" else ROOT / "build" / self.variant
        made = folder.joinpath(*name.split(".")).with_suffix(".abi3.so")
        if not made.is_file() or (source.is_file() and made.stat().st_mtime < source.stat().st_mtime):
            how = "--inplace" if self.variant == "release" else f"--variant {self.variant}"
            raise ImportError(f"{made} is missing or out of date: python setup.py build_ext {how}")
        return made


def install() -> None:
    """Make this process use the build that the environment selects."""
    variant = os.environ.get(VARIABLE, "release")
    finder = KernelFinder(variant)
    early = sorted(finder.compiled & sys.modules.keys())
    assert not early, f"{', '.join(early)} loaded before the choice of kernels"
    sys.meta_path.insert(0, finder)
