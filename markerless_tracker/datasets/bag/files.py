"""The MCAP files of a bag, in the order in which they were recorded."""

from pathlib import Path

import yaml

from markerless_tracker.datasets.video.numbering import in_order
from markerless_tracker.errors import DatasetError, one_line


def mcap_files(path: Path) -> list[Path]:
    """The files of a bag: those that its metadata.yaml names, or all of its folder.

    Args:
        path: the folder, or a single file.

    Raises:
        DatasetError: there is none, or another storage or compression.
    """
    if path.is_file():
        return [path]
    metadata = path / "metadata.yaml"
    if metadata.is_file():
        try:
            content = yaml.safe_load(metadata.read_text(encoding="utf-8"))
            information = content["rosbag2_bagfile_information"]
            storage = information["storage_identifier"]
            files = [path / str(name) for name in information["relative_file_paths"]]
            packed = information.get("compression_mode") or "none"
        except (OSError, ValueError, KeyError, TypeError, yaml.YAMLError, RecursionError) as error:
            what = one_line(error)
            raise DatasetError(f"{metadata}: not a rosbag2 description: {what}") from error
        if storage != "mcap":
            raise DatasetError(
                f"{path}: stored as {storage}, expected mcap (`ros2 bag convert` makes one)"
            )
        if str(packed).lower() in ("file", "message"):
            raise DatasetError(
                f"{path}: compressed by {packed}, expected none or compression inside the MCAP"
            )
        if not files:
            raise DatasetError(f"{metadata}: names no file")
        return files
    # The parts of a recording are numbered: name_9.mcap comes before name_10.mcap.
    files = sorted(path.glob("*.mcap"), key=in_order)
    if not files:
        raise DatasetError(f"{path}: no bag, expected a metadata.yaml or a .mcap file")
    return files
