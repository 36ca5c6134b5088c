"""`python -m hostlink`."""

from hostlink.commands.cli import main

if __name__ == "__main__":
    main()
