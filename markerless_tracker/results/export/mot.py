"""OpenSim motion files (`.mot`): angles in degrees, positions in metres."""

from pathlib import Path

from markerless_tracker.datasets.markers.trc import seconds
from markerless_tracker.results.export.coordinates import Coordinates, motion_columns
from markerless_tracker.results.export.new_file import new_file, number
from markerless_tracker.results.read import ResultReader


def write_mot(path: Path, reader: ResultReader, names: tuple[str, ...]) -> None:
    """Write the coordinates of the `.osim`: joint angles of the poses, the place of the pelvis.

    They move the model to the markers. Near 90 degrees of abduction (gimbal lock) they may jump
    from frame to frame, unlike the result's angles. Frames without a pose are rows of NaN, which
    OpenSim reads.

    Args:
        path: the file.
        reader: the result.
        names: the markers' names; a motion has none.

    Raises:
        DatasetError, BodyModelError: the file cannot be written, or the result's body is unknown.
    """
    body = reader.body()
    coordinates = Coordinates(body)
    frames = sum(len(part) for part in reader.chunks())
    begun = False
    with new_file(path) as sink:
        for part in reader.chunks():
            columns, values = motion_columns(part, coordinates)
            if not begun:
                sink.write(
                    f"{path.stem}\nversion=1\nnRows={frames}\nnColumns={1 + len(columns)}\n"
                    "inDegrees=yes\nendheader\n" + "\t".join(("time", *columns)) + "\n"
                )
                begun = True
            for stamp, row in zip(part.stamps_ns.tolist(), values.tolist(), strict=True):
                cells = [number(value, 6) or "NaN" for value in row]
                sink.write("\t".join((seconds(stamp), *cells)) + "\n")
