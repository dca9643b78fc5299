"""Finds the files of `config/`, wherever the package was installed."""

import os
import site
import sys
from collections.abc import Iterator
from pathlib import Path

from markerless_tracker.errors import ConfigError

_PACKAGE = "markerless_tracker"


def config_dir() -> Path:
    """The folder `config/` that belongs to this copy of the package.

    Looked for, in this order: beside the package in its source tree (editable installs and
    `colcon build --symlink-install` too); below the prefix that the package is installed in
    (colcon, pip, pip --user, pip --target); below Python's own prefixes; below
    `AMENT_PREFIX_PATH`, which may be unset.

    Raises:
        ConfigError: it is nowhere.
    """
    for candidate in _candidates(Path(__file__)):
        if candidate.is_dir():
            return candidate
    raise ConfigError(
        f"the folder config/ of {_PACKAGE} is not installed: neither beside the package "
        f"({Path(__file__).parent}) nor in share/{_PACKAGE} of {sys.prefix}"
    )


def config_file(name: str) -> Path:
    """A file of `config/`, by its path in there, such as ``demo/start.yaml``.

    Raises:
        ConfigError: there is no such file; the message names those beside it.
    """
    folder = config_dir()
    path = folder / name
    if not path.is_file():
        beside = sorted(p.name for p in path.parent.glob("*") if p.is_file())
        raise ConfigError(
            f"no file {name!r} in {folder}, there are {', '.join(beside) if beside else 'none'}"
        )
    return path


def _candidates(module: Path) -> Iterator[Path]:
    """Folders that may be ours, best first, for a package whose `module` lies at that path."""
    source = module.resolve().parent.parent
    if (source / "setup.py").is_file():
        yield source / "config"
    share = Path("share", _PACKAGE, "config")
    for package in dict.fromkeys([module.parent, module.resolve().parent]):
        # PREFIX/lib/python3.x/site-packages/PACKAGE is four levels down (five below local/).
        for prefix in list(package.parents)[:5]:
            yield prefix / share
    prefixes = [sys.prefix, f"{sys.prefix}/local", site.getuserbase()]
    prefixes += os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    for text in prefixes:
        if text:
            yield Path(text) / share
