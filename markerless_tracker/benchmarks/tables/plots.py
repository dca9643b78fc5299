"""Plots of the error over time: one per recording and rate, with a line per row of a table."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from markerless_tracker.errors import ConfigError


def write_plot(path: Path, title: str, lines: Sequence[tuple[str, Mapping[str, Any]]]) -> None:
    """Draw rows' errors over time (mean over the joints and seeds, mm) into a PNG.

    Args:
        path: the file; its folder is made.
        title: title of the plot.
        lines: legend and row (as returned by `accuracy.summarise`) of each line.

    Raises:
        ConfigError: matplotlib is not installed.
        OSError: the file cannot be written.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise ConfigError(
            "plots: matplotlib is not installed, expected markerless_tracker[plots]"
        ) from error
    figure = Figure(figsize=(9.0, 4.5), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for label, row in lines:
        curve = row["curve"]
        axes.plot(
            curve["s"], curve["mean_mm"], linewidth=1.2, label=f"{label}: {row['mean_mm']:.1f} mm"
        )
    axes.set(title=title, xlabel="s", ylabel="mean error over the joints, mm")
    axes.set_ylim(bottom=0.0)
    axes.grid(alpha=0.3)
    axes.legend(fontsize="small")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=120)
