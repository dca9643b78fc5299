"""The demo's recording: four calibrated cameras, part of a wheel on the package index."""

import hashlib
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

from markerless_tracker.datasets.target import new_folder
from markerless_tracker.errors import DatasetError

REQUIREMENT = "pose2sim==0.10.49"
"""The wheel; BSD-3-Clause, by David Pagnon and the contributors of Pose2Sim."""

SHA256 = "403e0dc4065898ba6a595e72a8970950310979253d60e24c2e00b16b36bf21e1"

_PROJECT = "Pose2Sim/Demo_SinglePerson/"
_WANTED = ("videos/", "calibration/extrinsics/", "calibration/Calib")


def fetch_recording(folder: Path) -> Path:
    """The Pose2Sim project of the demo, downloaded unless the folder has it.

    Args:
        folder: gets the wheel in `wheel/` and the project in `recording/`.

    Returns:
        The project's folder.

    Raises:
        DatasetError: the wheel cannot be downloaded, or is not the one expected.
    """
    project = folder / "recording"
    if project.is_dir():
        return project
    wheel = download_wheel(folder / "wheel")
    unpack(wheel, project)
    return project


def download_wheel(folder: Path) -> Path:
    """Download the wheel with pip, without its dependencies.

    Raises:
        DatasetError: pip cannot download it, or its checksum differs.
    """
    name, _, version = REQUIREMENT.partition("==")
    pattern = f"{name}-{version}-*.whl"
    if not any(folder.glob(pattern)):
        folder.mkdir(parents=True, exist_ok=True)
        done = subprocess.run(
            [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check"]
            + ["--no-deps", "--only-binary", ":all:", "--dest", str(folder), REQUIREMENT],
            capture_output=True,
            text=True,
            stdin=subprocess.DEVNULL,
        )
        if done.returncode != 0:
            said = [line for line in done.stderr.splitlines() if line.startswith("ERROR")]
            reason = said[-1] if said else f"pip ended with status {done.returncode}"
            raise DatasetError(f"{REQUIREMENT} cannot be downloaded: {reason}")
    wheel = next(folder.glob(pattern), None)
    if wheel is None:
        raise DatasetError(f"{folder}: pip left no {pattern} there")
    digest = hashlib.sha256(wheel.read_bytes()).hexdigest()
    if digest != SHA256:
        wheel.unlink()
        raise DatasetError(f"{wheel.name}: its SHA-256 is {digest}, expected {SHA256}")
    return wheel


def unpack(wheel: Path, project: Path) -> None:
    """Unpack the recording's videos, calibration and stills from the wheel.

    Raises:
        DatasetError: the wheel is not an archive, or does not hold the recording.
    """
    try:
        with zipfile.ZipFile(wheel) as archive, new_folder(project) as partial:
            wanted = [
                info
                for info in archive.infolist()
                if not info.is_dir()
                and info.filename.removeprefix(_PROJECT).startswith(_WANTED)
                and info.filename.startswith(_PROJECT)
                and ".." not in info.filename
            ]
            if not wanted:
                raise DatasetError(f"{wheel}: holds no {_PROJECT}")
            for info in wanted:
                target = partial / info.filename.removeprefix(_PROJECT)
                target.parent.mkdir(parents=True, exist_ok=True)
                with archive.open(info) as source, target.open("wb") as sink:
                    shutil.copyfileobj(source, sink)
    except zipfile.BadZipFile as error:
        raise DatasetError(f"{wheel}: not a wheel ({error})") from error
