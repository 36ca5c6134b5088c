"""Ctrl-C while a program starts ends it without a traceback, whichever module is being imported."""

import signal
import sys
from pathlib import Path

import pytest

from hostlink.interrupt import ENDING
from tests.support.processes import program, python, uncounted

# Interrupts itself where the module named first is imported, in the program named second.
PROGRAM = """
import os, runpy, signal, sys

at, program, *arguments = sys.argv[1:]

class Interrupting:
    def find_spec(self, name, path=None, target=None):
        if name == at:
            sys.meta_path.remove(self)
            print("interrupted", flush=True)
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Interrupting())
sys.argv = [program, *arguments]
runpy.run_module(program, run_name="__main__", alter_sys=True)
"""


@pytest.mark.parametrize("arguments", [
    "click hostlink --help",
    "hostlink.client hostlink monitor can:none",
    "click edge --help",
    "edge.cli.inspect edge inspect tip.png",
    "datetime edge inspect tip.png",  # in the middle of NumPy's compiled modules
    "numpy edge replay touch.mcap",
    "numpy calib fit touch.mcap -o tip.json",
])  # fmt: skip
def test_an_interrupted_import_is_no_traceback(arguments: str, tmp_path: Path) -> None:
    ended = python("-c", PROGRAM, *arguments.split(), cwd=tmp_path, env=uncounted())
    assert ended.stdout == "interrupted\n", "the module was not imported"
    assert (ended.returncode, ended.stderr) == (130, "")


@pytest.mark.parametrize("program", ["edge", "hostlink", "calib"])
def test_nothing_lies_between_the_imports_and_the_command(program: str) -> None:
    code = (
        f"import os, signal; from hostlink import cli_exit; from {program}.__main__ import main; "
        "cli_exit._replace_closed_streams = lambda: os.kill(os.getpid(), signal.SIGINT); main()"
    )
    ended = python("-c", code, "--help")
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "")


def test_a_background_job_stays_deaf() -> None:
    """A shell starts it with SIGINT ignored: Ctrl-C is for what runs in front."""
    deaf = 'trap "" INT; exec "$0" -c "$1" click hostlink --help'
    ended = program("bash", "-c", deaf, sys.executable, PROGRAM)
    assert ended.returncode == 0
    assert ended.stdout.startswith("interrupted\nUsage: ")


COMMAND = """
import os, signal, sys, weakref, click
from hostlink.cli_exit import run_command

@click.command()
@click.argument("where")
@click.argument("number", type=int)
def command(where, number):
    if where == "in a callback":  # Python ignores what is raised there
        for _ in range(2):
            thing = type("Thing", (), {})()
            callback = weakref.ref(thing, lambda _: os.kill(os.getpid(), number))
            del thing
        signal.pause()
    try:
        os.kill(os.getpid(), number)
    except KeyboardInterrupt:
        raise ValueError("no valid format") from None

sys.exit(run_command(command, "command", ()))
"""


@pytest.mark.parametrize("number", ENDING)
@pytest.mark.parametrize("where", ["in a callback", "where a library makes another error of it"])
def test_a_signal_that_somebody_swallows_ends_the_command(where: str, number: signal.Signals) -> None:
    ended = python("-c", COMMAND, where, str(int(number)), env=uncounted())
    assert (ended.returncode, ended.stderr.strip()) == (128 + number, "")
