"""`python -m hostlink`."""

from hostlink.cli import main

if __name__ == "__main__":
    main()
