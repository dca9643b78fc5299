"""The verdict of a run, in words and as a mapping."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from markerless_tracker.body.description import BodyDescription
from markerless_tracker.records import TrackState
from markerless_tracker.results.verdict.doubts import (
    causes_of_nobody,
    doubts_about_fit,
    doubts_about_start,
    stature_is_plausible,
    stature_m,
)
from markerless_tracker.results.verdict.record import RunRecord

CLEARLY = 0.02
"""A camera fits worst only if its overlap is lower than all others by this difference."""
PICTURES = "`track --debug-images DIR` shows silhouettes and body of every frame"
"""Advice on where to look, for a run of the verb `track`."""


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """What happened in a run.

    Attributes:
        frames: frames processed.
        tracked, searching, lost: number of frames in that state.
        overlap: camera -> median overlap (IoU) of its silhouette and the body.
        stature_m: stature of the body; None without a body.
        stature_plausible: whether it is that of a grown person; None without a body.
        worst_limb: the limb lost in most tracked frames; empty if none was lost.
        worst_limb_lost: the number of those frames.
        frames_with_warnings: frames with any warning.
        warnings: number of kinds of warnings.
        doubts: what is doubtful, one line each.
        causes: why nobody may have been found, one line each; empty if somebody was.
        look: where to look next.
    """

    frames: int
    tracked: int
    searching: int
    lost: int
    overlap: Mapping[str, float]
    stature_m: float | None
    stature_plausible: bool | None
    worst_limb: str
    worst_limb_lost: int
    frames_with_warnings: int
    warnings: int
    doubts: tuple[str, ...]
    causes: tuple[str, ...]
    look: str

    @property
    def counts(self) -> str:
        """Frames by state, in words."""
        return (
            f"{self.frames} frames, {self.tracked} tracked, {self.lost} lost, "
            f"{self.searching} searching"
        )

    @property
    def kinds(self) -> str:
        """The number of kinds of warnings, in words."""
        return f"{self.warnings} kind{'' if self.warnings == 1 else 's'}"

    def lines(self) -> list[str]:
        """Everything but the counts, one line each."""
        found = []
        if self.overlap:
            listed = ", ".join(f"{name} {value:.2f}" for name, value in self.overlap.items())
            found.append(f"overlap of body and silhouettes: {listed}")
        if self.stature_m is not None:
            unusual = "" if self.stature_plausible else ", not a grown person's"
            found.append(f"stature of the body {self.stature_m:.2f} m{unusual}")
        if self.worst_limb:
            limb, lost = limb_in_words(self.worst_limb), self.worst_limb_lost
            found.append(f"worst limb: {limb}, lost in {lost} of {self.tracked} tracked frames")
        if self.frames_with_warnings:
            count = self.frames_with_warnings
            found.append(f"warnings in {count} frame{'s' * (count != 1)}: {self.kinds}")
        found += [f"doubt: {text}" for text in self.doubts]
        found += [f"likely cause: {text}" for text in self.causes]
        return [*found, f"next: {self.look}"]

    def as_mapping(self) -> dict[str, Any]:
        """The verdict for JSON."""
        return {
            "frames": self.frames,
            "tracked": self.tracked,
            "searching": self.searching,
            "lost": self.lost,
            "overlap": {name: round(value, 3) for name, value in self.overlap.items()},
            "stature_m": None if self.stature_m is None else round(self.stature_m, 3),
            "stature_plausible": self.stature_plausible,
            "worst_limb": self.worst_limb or None,
            "worst_limb_lost": self.worst_limb_lost,
            "frames_with_warnings": self.frames_with_warnings,
            "warnings": self.warnings,
            "doubts": list(self.doubts),
            "causes": list(self.causes),
            "look": self.look,
        }


def verdict_of(
    record: RunRecord,
    description: BodyDescription,
    *,
    known: Sequence[str] = (),
    start_given: bool = False,
    search_faults: bool = True,
    pictures: str = PICTURES,
) -> Verdict:
    """The verdict of a run.

    Args:
        record: its frames.
        description: of the body that was tracked.
        known: doubts from elsewhere, such as those about the calibration.
        start_given: whether a start pose was given.
        search_faults: whether to search for exchanged cameras in a doubtful run; takes some
            seconds.
        pictures: advice on how to see silhouettes and body.
    """
    somebody = record.tracked > 0
    stature = None if record.body is None else stature_m(description, record.body)
    doubts, causes = list(known), []
    if somebody:
        doubts += doubts_about_start(record) if start_given else []
        doubts += doubts_about_fit(record, description, search_faults=search_faults)
    elif record.frames:
        causes = causes_of_nobody(record, start_given=start_given, search_faults=search_faults)
    limb, frames = max(record.lost_limbs.items(), key=lambda item: item[1], default=("", 0))
    return Verdict(
        frames=record.frames,
        tracked=record.tracked,
        searching=record.states[TrackState.SEARCHING.value],
        lost=record.states[TrackState.LOST.value],
        overlap={n: v for n, v in record.median_overlap.items() if math.isfinite(v)},
        stature_m=stature,
        stature_plausible=None if stature is None else stature_is_plausible(stature),
        worst_limb=limb if frames else "",
        worst_limb_lost=frames,
        frames_with_warnings=record.warnings.frames,
        warnings=len(record.warnings.kinds),
        doubts=tuple(dict.fromkeys(doubts)),
        causes=tuple(dict.fromkeys(causes)),
        look=_where_to_look(record, pictures, doubtful=bool(doubts)),
    )


def limb_in_words(limb: str) -> str:
    """A limb's name in words: `left arm` for `l_arm`."""
    side, _, part = limb.partition("_")
    sides = {"l": "left", "r": "right"}
    return f"{sides[side]} {part}" if part and side in sides else limb


def fits_worst(overlap: Mapping[str, float]) -> str:
    """The camera whose overlap lies clearly below those of all others; empty if there is none.

    Args:
        overlap: camera -> overlap (IoU) of its silhouette and the body.
    """
    known = sorted((value, name) for name, value in overlap.items() if math.isfinite(value))
    if len(known) < 2 or known[1][0] - known[0][0] < CLEARLY:
        return ""
    return known[0][1]


def _where_to_look(record: RunRecord, pictures: str, *, doubtful: bool) -> str:
    if not record.frames:
        return "there was no frame"
    if not record.tracked:
        return pictures
    longest = max(record.stretch, record.before, key=lambda stretch: stretch.frames)
    if longest.frames:
        begin, end = longest.from_ns / 1e9, longest.to_ns / 1e9
        return (
            f"nobody was tracked from {begin:.2f} to {end:.2f} s ({longest.frames} frames); "
            f"{pictures}"
        )
    if doubtful:
        return pictures
    worst = fits_worst(record.median_overlap)
    return f"{worst} fits worst; {pictures}" if worst else pictures
