"""Where the files lie that come with the program, in a source tree and in an installed wheel alike."""

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent


def folder(name: str) -> Path:
    """The folder `nets`, `routes` or `faults` of this installation."""
    installed = _PACKAGE / name
    return installed if installed.is_dir() else _PACKAGE.parent / name


def scenario_path(path: Path) -> Path:
    """`path` itself, or the built-in scenario that it names (`nets/cs1.sumocfg`) when there is no such file.

    Without a folder `nets` the built-in ones are meant, so that the nearest of them can be told.
    """
    try:
        if path.exists() or path.is_absolute() or path.parts[:1] != ("nets",):
            return path
        built_in = folder("nets") / Path(*path.parts[1:])
        return built_in if built_in.exists() or not path.parent.is_dir() else path
    except OSError:  # who reads it says what is wrong with it
        return path
