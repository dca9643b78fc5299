"""People that are not a tracker's cones: own skeleton, lofted flesh, loose cloth, hair.

`spec` samples a person, `person` builds and poses the surface, `postures` moves it.
"""

from markerless_tracker.synthesis.people.person import Person, PosedSurface
from markerless_tracker.synthesis.people.postures import ACTIONS, Action
from markerless_tracker.synthesis.people.spec import PersonSpec, sample_person

__all__ = ["ACTIONS", "Action", "Person", "PersonSpec", "PosedSurface", "sample_person"]
