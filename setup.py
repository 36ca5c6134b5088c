"""Compiles the kernels. pip runs this; by hand:

python setup.py build_ext --inplace              as pip does: beside their sources
python setup.py build_ext --variant checked      into build/checked: every index is checked
python setup.py build_ext --variant sanitized    into build/sanitized: sanitizers of addresses and behaviour

A kernel is a Python module that Cython compiles. A new one needs a line in KERNELS and nothing else.
"""

from __future__ import annotations

import fcntl
import multiprocessing
import os
import re
from pathlib import Path
from typing import NamedTuple

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

#: The limited API of CPython 3.11: one wheel for 3.11 and every later release.
LIMITED_API = [("Py_LIMITED_API", "0x030B0000"), ("CYTHON_LIMITED_API", "1")]

FAST = ["-O3", "-fno-math-errno", "-fno-wrapv"]
#: Modules with few or short loops get less code.
SMALL = ["-O2", *FAST[1:]]
#: Exact arithmetic: a multiplication and an addition must not become one operation with one rounding.
EXACT = ["-O3", "-ffp-contract=off"]
#: Sums over the pixels of narrow windows take fewer steps so.
UNROLLED = [*FAST, "-funroll-loops"]
#: Kernel -> flags of the C compiler.
KERNELS = {
    "edge.calibration.evaluation": FAST,
    "edge.cells.mesh": EXACT,
    "edge.features.contact_detector": FAST,
    "edge.features.contact_field": FAST,
    "edge.features.several.contact_fit": FAST,
    "edge.features.contacts": FAST,
    "edge.features.extract": SMALL,
    "edge.features.pin_motion": FAST,
    "edge.features.slip_and_vibration": FAST,
    "edge.geometry.copies": SMALL,
    "edge.geometry.neighbours": FAST,
    "edge.geometry.select": FAST,
    "edge.pins.centroids": FAST,
    "edge.faults.detector": SMALL,
    "edge.faults.frame_counts": UNROLLED,
    "edge.link.state_packer": SMALL,
    "edge.tracking.follow": FAST,
    "edge.tracking.match": FAST,
    "edge.tracking.outliers": FAST,
    "hostlink.decoder": SMALL,
    "hostlink.order_and_time": SMALL,
    "hostlink.wire.body": SMALL,
}
#: Cython's own code for typed memoryviews, which all kernels share.
SHARED = "edge._memoryview"
#: No array of a kernel has as many; each takes 112 bytes of the kernel then, not 208 as with Cython's 8.
DIMENSIONS = 4


class Variant(NamedTuple):
    """One way to build the kernels: Cython's directives, and flags added for compiler and linker."""

    directives: dict[str, bool | int]
    compile_args: tuple[str, ...] = ()
    link_args: tuple[str, ...] = ()


RELEASE = {
    "language_level": 3,
    "boundscheck": False,
    "wraparound": False,
    "cdivision": True,
    "initializedcheck": False,
    "auto_pickle": False,
    "binding": False,
}
ALL = ["-std=c11", "-g0", "-fno-plt", "-Werror=incompatible-pointer-types"]  # the last is GCC 14's default
CHECKED = RELEASE | {"boundscheck": True, "initializedcheck": True}
SANITIZE = ("-fsanitize=address,undefined", "-fno-sanitize-recover=undefined")
VARIANTS = {
    "release": Variant(RELEASE),
    "checked": Variant(CHECKED, ("-O1",)),
    "sanitized": Variant(RELEASE, ("-O1", "-g", *SANITIZE), SANITIZE),
}


def extensions(variant: Variant) -> list[Extension]:
    """All that is to be compiled."""
    sources = [(name, ".py", flags) for name, flags in KERNELS.items()]
    return [
        Extension(
            name,
            [name.replace(".", "/") + suffix],
            define_macros=LIMITED_API,
            include_dirs=[str(Path(*name.split(".")[:-1]))],
            extra_compile_args=[*ALL, *flags, *variant.compile_args],
            extra_link_args=list(variant.link_args),
            py_limited_api=True,
        )
        for name, suffix, flags in [*sources, (SHARED, ".c", ["-O2"])]
    ]


class BuildKernels(build_ext):
    """Python to C in build/VARIANT/c, then C to modules, on all processors; what is up to date stays."""

    user_options = [*build_ext.user_options, ("variant=", None, f"one of {', '.join(VARIANTS)}")]  # noqa: RUF012

    def initialize_options(self) -> None:
        super().initialize_options()
        self.variant = "release"

    def finalize_options(self) -> None:
        if self.variant not in VARIANTS:
            raise SystemExit(f"setup.py: no variant {self.variant}; choose {', '.join(VARIANTS)}")
        self.distribution.ext_modules = extensions(VARIANTS[self.variant])
        super().finalize_options()
        self.parallel = self.parallel or len(os.sched_getaffinity(0))
        # Compiled here and copied to where setuptools wants it: what is up to date is not compiled again.
        host = "_PYTHON_HOST_PLATFORM" not in os.environ
        self.place = Path("build", self.variant if host else f"{self.variant}-{self.plat_name}")
        self.build_temp = str(self.place / "o")
        if self.variant != "release" or self.inplace:
            self.build_lib = str(self.place)

    def run(self) -> None:
        self.place.mkdir(parents=True, exist_ok=True)
        # One build at a time: pip's finds all done that make has compiled while pip fetched packages.
        with (self.place / "lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            wanted, self.build_lib = self.build_lib, str(self.place)
            self._remove_others()
            super().run()
            made, self.build_lib = self.get_outputs(), wanted
            for source in made:
                target = Path(wanted, Path(source).relative_to(self.place))
                if target != Path(source):
                    self.mkpath(str(target.parent))
                    self.copy_file(source, str(target))

    def _remove_others(self) -> None:
        """Python would load a compiled module that KERNELS no longer has in place of its source."""
        known = {f"{name.replace('.', '/')}.abi3.so" for name in (*KERNELS, SHARED)}
        for folder in [self.place, *([Path()] if self.inplace else [])]:
            for package in ("edge", "hostlink"):
                for path in (folder / package).rglob("*.abi3.so"):
                    if path.relative_to(folder).as_posix() not in known:
                        path.unlink()

    def build_extensions(self) -> None:
        self._translate()
        super().build_extensions()

    def _translate(self) -> None:
        """Replace each kernel's Python by the C that Cython makes of it."""
        from Cython.Compiler import Options

        Options.buffer_max_dims = DIMENSIONS  # before the next import reads it, and for forked processes
        multiprocessing.set_start_method("fork", force=True)
        from Cython.Build import cythonize

        folder = self.place / "c"
        directives = VARIANTS[self.variant].directives
        for extension in self.extensions:
            made = folder / Path(*extension.name.split("."))
            note = made.with_suffix(".settings")
            settings = repr((directives, DIMENSIONS, extension.extra_compile_args))
            if not note.is_file() or note.read_text() != settings:  # what is there was made otherwise
                made.with_suffix(".c").unlink(missing_ok=True)
                note.parent.mkdir(parents=True, exist_ok=True)
                note.write_text(settings)
            extension.depends = [str(note), *map(str, Path(*extension.name.split(".")[:-1]).glob("*.c"))]
        for package in ("edge.", "hostlink."):
            own = [extension for extension in self.extensions if extension.name.startswith(package)]
            translated = cythonize(
                own,
                build_dir=str(folder),
                compiler_directives=directives,
                shared_utility_qualified_name=SHARED if SHARED.startswith(package) else None,
                nthreads=self.parallel,
                quiet=not self.verbose,
                show_all_warnings=False,
            )
            for extension, c in zip(own, translated, strict=True):
                extension.sources = c.sources


def page_of(readme: str, repository: str) -> str:
    """README as a package index shows it: links and pictures lead to the repository, or are left out where it
    is not known.
    """

    def link(found: re.Match[str]) -> str:
        picture, text, target = found.groups()
        if "://" in target:
            return found[0]
        if not repository:
            return "" if picture else text
        return f"{picture}[{text}]({repository}/{'raw' if picture else 'blob'}/HEAD/{target})"

    return re.sub(r"(!?)\[([^\]]*)\]\(([^)\s]+)\)", link, readme)


def about(repository: str) -> dict[str, object]:
    """What pyproject.toml leaves to this file. The workflow that releases says where the repository is."""
    readme = (Path(__file__).parent / "README.md").read_text(encoding="utf-8")
    urls = {"Source": repository, "Issues": f"{repository}/issues"} if repository else {}
    kind = {"long_description_content_type": "text/markdown", "project_urls": urls}
    return {"long_description": page_of(readme, repository), **kind}


if __name__ == "__main__":
    server, name = (os.environ.get(f"GITHUB_{what}", "") for what in ("SERVER_URL", "REPOSITORY"))
    # The list is made anew for the variant that is asked for; without one here, there would be no build_ext.
    setup(
        ext_modules=extensions(VARIANTS["release"]),
        cmdclass={"build_ext": BuildKernels},
        **about(f"{server}/{name}" if server and name else ""),
    )
