"""The commands of `python -m calib`, a module each, imported when it is called."""
