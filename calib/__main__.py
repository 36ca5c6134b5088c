"""`python -m calib`: the calibration's program. Its commands: `calib.commands.cli`."""

from typing import NoReturn

from hostlink.interrupt import exit_on_interrupt


def main() -> NoReturn:
    """Run a command and exit, with the exit codes of `hostlink.cli_exit`."""
    with exit_on_interrupt():  # imports take a part of a second; `run` takes over from here
        from calib.commands.cli import main as run

        run()


if __name__ == "__main__":
    main()
