"""Loading of bodies and their descriptions by name or file."""

from pathlib import Path

from markerless_tracker.body.build import build_body
from markerless_tracker.body.description import BodyDescription, read_description
from markerless_tracker.body.model import BodyModel
from markerless_tracker.body.subject import Subject, subject_from_stature
from markerless_tracker.errors import BodyModelError
from markerless_tracker.resources import config_dir


def load_description(name_or_file: str | Path) -> BodyDescription:
    """The description of a shipped body (by name) or of a YAML file.

    Raises:
        BodyModelError: there is no such body; the message lists the shipped ones.
    """
    path = Path(name_or_file)
    if path.suffix in (".yaml", ".yml"):
        return read_description(path)
    folder = config_dir() / "bodies"
    shipped = folder / f"{name_or_file}.yaml"
    if not shipped.is_file():
        names = ", ".join(sorted(p.stem for p in folder.glob("*.yaml")))
        raise BodyModelError(
            f"body {str(name_or_file)!r} is unknown, expected {names} or a .yaml file"
        )
    return read_description(shipped)


def load_body(name_or_file: str | Path, subject: Subject | float = 1.72) -> BodyModel:
    """A body with a subject's sizes; a number is a stature in metres.

    Raises:
        BodyModelError: there is no such body, it is malformed (the message names the file), or the
            subject does not fit it.
    """
    description = load_description(name_or_file)
    if not isinstance(subject, Subject):
        subject = subject_from_stature(description, subject)
    try:
        return build_body(description, subject)
    except BodyModelError as error:
        # Errors of the subject do not name the description.
        if str(error).startswith("subject ") or str(name_or_file) == description.name:
            raise
        raise BodyModelError(f"{name_or_file}: {error}") from error
