"""C files beside this one, compiled when they are first used."""

import ctypes
import shutil
import subprocess
import sysconfig
import tempfile
from functools import lru_cache
from pathlib import Path


@lru_cache
def compiled(name: str) -> ctypes.CDLL:
    """A C file of this folder as a loaded library."""
    compiler = (sysconfig.get_config_var("CC") or "cc").split()[0]
    source = Path(__file__).with_name(name)
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / f"{source.stem}.so"
        command = [shutil.which(compiler) or "cc", "-O3", "-shared", "-fPIC"]
        subprocess.run([*command, str(source), "-o", str(library)], check=True)
        return ctypes.CDLL(str(library))
