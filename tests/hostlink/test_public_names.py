"""`import hostlink` imports nothing else; each public name is imported when it is first used."""

import ast
from importlib import import_module
from pathlib import Path

import click
import pytest

import hostlink
from calib.commands import cli as calib_cli
from edge.cli import program as edge_cli
from hostlink.commands import cli as host_cli
from tests.support.processes import python


def typed_names() -> dict[str, str]:
    """What a type checker sees: each name and its module."""
    assert hostlink.__file__ is not None
    tree = ast.parse(Path(hostlink.__file__).read_text(encoding="utf-8"))
    imports = [(str(n.module), n.names) for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)]
    ours = [(module, names) for module, names in imports if module.startswith("hostlink.")]
    return {alias.name: module for module, names in ours for alias in names}


def test_names_are_those_that_a_type_checker_sees() -> None:
    typed = typed_names()
    assert sorted(hostlink.__all__) == sorted(typed)
    assert set(hostlink.__all__) <= set(dir(hostlink))
    for name, module in typed.items():
        assert getattr(hostlink, name) is getattr(import_module(module), name)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module 'hostlink' has no attribute 'conect'"):
        hostlink.conect  # type: ignore[attr-defined]  # noqa: B018 - read for its error


def run(code: str) -> str:
    return python("-c", code, check=True).stdout


def test_importing_the_package_imports_none_of_its_modules() -> None:
    heavy = "{'numpy', 'cv2', 'scipy', 'can', 'serial', 'rich', 'click', 'edge', 'calib'}"
    assert run("import sys, hostlink; print([m for m in sys.modules if m.startswith('hostlink.')])") == "[]\n"
    assert run(f"import sys, hostlink; print({heavy} & set(sys.modules))") == "set()\n"
    assert run("import hostlink; print(hostlink.errors.LinkError.__name__)") == "LinkError\n"
    assert run("from hostlink import *; print(connect.__name__)") == "connect\n"


@pytest.mark.parametrize("group", [host_cli, edge_cli, calib_cli], ids=["hostlink", "edge", "calib"])
def test_summaries_are_the_first_sentences_of_the_commands_help(group: object) -> None:
    commands, cli = group.COMMANDS, group.cli  # type: ignore[attr-defined]
    for name, row in commands.items():
        command = cli.get_command(click.Context(cli), name)
        assert row.summary == command.get_short_help_str(limit=200)
