"""`python -m edge`: the finger's own program. Its commands: `edge.cli.program`."""

from typing import NoReturn

from hostlink.interrupt import exit_on_interrupt


def main() -> NoReturn:
    """Run a command and exit, with the exit codes of `hostlink.cli_exit`."""
    with exit_on_interrupt():  # imports take a part of a second; `run` takes over from here
        from edge.cli.program import main as run

        run()


def program() -> NoReturn:
    """`main`, for its own process."""
    with exit_on_interrupt():
        from edge.runtime.process import run_and_exit

        run_and_exit(main)


if __name__ == "__main__":
    program()
