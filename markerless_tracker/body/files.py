"""Reading of the YAML files of bodies, subjects and poses."""

from pathlib import Path
from typing import Any

import yaml

from markerless_tracker.errors import BodyModelError


def read_yaml(path: Path, what: str) -> Any:
    """Content of a YAML file.

    Args:
        path: the file.
        what: kind of the file, for the message.

    Raises:
        BodyModelError: the file cannot be read or is no YAML.
    """
    try:
        return yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError, RecursionError) as error:
        first = str(error).splitlines()[0]
        raise BodyModelError(f"{path}: cannot read the {what}: {first}") from error
