"""Level and message of the diagnostics of a running tracker."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from types import MappingProxyType

from markerless_tracker.records import TrackState

QUIET_S = 2.0
"""Time without images, sets or results after which their absence is reported."""
MOST_SKIPPED = 0.5
"""Share of skipped sets from which they are reported."""
PROCESSING = "processing images"
"""Activity of a tracker that processes images as they come."""
NEWS: Mapping[TrackState, str] = MappingProxyType(
    {
        TrackState.TRACKING: "person found",
        TrackState.LOST: "person lost",
        TrackState.SEARCHING: "searching for a person",
    }
)
"""The words for a state in the diagnostics and in the log."""

_NOTHING = "no image from any camera"


class Level(Enum):
    """Levels of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    STALE = 3


@dataclass(frozen=True, kw_only=True)
class Facts:
    """Condition of a running tracker at one moment; ages in s, None for events that never occurred.

    Attributes:
        ready: whether it tracks images as they come.
        activity: what it is doing, in a few words.
        state: of the last result.
        cameras: names of all cameras.
        silent: cameras without a usable image for `QUIET_S`.
        left_out: cameras that sets are complete without.
        refusals: camera -> reason why its last image could not be used.
        ready_age_s: since it became ready.
        set_age_s: since the last complete set of images.
        result_age_s: since the last result.
        offsets_ns: camera -> offset of its stamps from those of the others.
        tolerance_s: `sync_tolerance`.
        repeating: whether images arrive whose stamps repeat the previous ones.
        last_error: error of the last set; empty if it was tracked.
        clock_missing: whether `use_sim_time` is set and no /clock is received.
        doubts: about the run so far, one line each.
        skipped: share of the sets that were skipped for newer ones lately.
    """

    ready: bool
    activity: str
    state: TrackState
    cameras: Sequence[str]
    silent: Sequence[str] = ()
    left_out: Sequence[str] = ()
    refusals: Mapping[str, str] = field(default_factory=dict)
    ready_age_s: float | None = None
    set_age_s: float | None = None
    result_age_s: float | None = None
    offsets_ns: Mapping[str, int] = field(default_factory=dict)
    tolerance_s: float = 0.0
    repeating: bool = False
    last_error: str = ""
    clock_missing: bool = False
    doubts: Sequence[str] = ()
    skipped: float | None = None


@dataclass(frozen=True)
class Health:
    """Level and message of the diagnostics.

    Attributes:
        level: the level.
        message: one line.
        trouble: the reason for missing results; empty if there are results, None while unknown.
        without: the cameras that results come without, and why; empty if there is none, None
            without recent results.
        skipping: says that most sets are skipped; empty if they are not.
    """

    level: Level
    message: str
    trouble: str | None = None
    without: str | None = None
    skipping: str = ""


def assess(facts: Facts) -> Health:
    """The level and message of a tracker's diagnostics.

    OK: the person is tracked with every camera, and nothing is doubtful. STALE: no image arrives.
    WARN: anything else.
    """
    health = _assess(facts)
    if not facts.clock_missing:
        return health
    clock = "use_sim_time is set and no /clock is received"
    level = Level.WARN if health.level is Level.OK else health.level
    return replace(health, level=level, message=f"{health.message}; {clock}")


def _assess(facts: Facts) -> Health:
    if not facts.ready:
        return Health(Level.WARN, f"{facts.state.value}: {facts.activity}")
    if _recent(facts.result_age_s):
        return _working(facts)
    if not _long(facts.ready_age_s):
        return Health(Level.WARN, f"{facts.state.value}: {facts.activity}")
    if _recent(facts.set_age_s) and not facts.last_error:
        return Health(Level.WARN, f"{facts.state.value}: {facts.activity}")
    trouble = _trouble(facts)
    level = Level.STALE if trouble == _NOTHING else Level.WARN
    return Health(level, f"{facts.state.value}: {trouble}", trouble)


def _working(facts: Facts) -> Health:
    problems = [facts.refusals.get(name, f"no image of {name}") for name in facts.left_out]
    without = ""
    if problems:
        without = f"tracking without {', '.join(facts.left_out)}: {'; '.join(problems)}"
    if facts.state is not TrackState.TRACKING:
        doing = NEWS[facts.state] if facts.activity == PROCESSING else facts.activity
        message = f"{facts.state.value}: {doing}"
        return Health(Level.WARN, f"{message}; {without}" if without else message, "", without)
    if without:
        return Health(Level.WARN, f"{facts.state.value}: {without}", "", without)
    if facts.doubts:
        return Health(Level.WARN, f"{facts.state.value}: doubt: {facts.doubts[0]}", "", without)
    skipping = _skipping(facts)
    message = f"{facts.state.value}: {skipping}" if skipping else facts.state.value
    return Health(Level.OK, message, "", without, skipping)


def _skipping(facts: Facts) -> str:
    if facts.skipped is None or facts.skipped < MOST_SKIPPED:
        return ""
    share = f"{100.0 * facts.skipped:.0f} %"
    return f"{share} of the sets are skipped: they come faster than this machine tracks them"


def _trouble(facts: Facts) -> str:
    """Reason for missing results."""
    if _recent(facts.set_age_s):
        return f"no result for {QUIET_S:g} s: {facts.last_error}"
    if facts.refusals:
        return f"no complete set of images: {'; '.join(facts.refusals.values())}"
    if facts.repeating:
        return "no new set of images: the images repeat their stamps"
    if set(facts.silent) == set(facts.cameras):
        return _NOTHING
    if facts.silent:
        return f"no complete set of images: none from {', '.join(facts.silent)}"
    return f"no complete set of images: {_spread(facts)}"


def _spread(facts: Facts) -> str:
    offsets = {name: offset for name, offset in facts.offsets_ns.items() if offset}
    if not offsets:
        return "their stamps do not match"
    listed = ", ".join(f"{name} by {offset / 1e6:+.6g} ms" for name, offset in offsets.items())
    return f"stamps differ, {listed}; sync_tolerance is {facts.tolerance_s:g} s"


def _recent(age_s: float | None) -> bool:
    return age_s is not None and age_s < QUIET_S


def _long(age_s: float | None) -> bool:
    return age_s is not None and age_s >= QUIET_S
