"""Frozen values that cross rooms: evidence of one image, one stage of a search, one result."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.errors import ImageError, SearchError

MaskWords = NDArray[np.uint64]

CONTOUR = "contour"
"""The algorithm of a stage that refines on contours instead of evaluating particles."""


def locked(array: Any, dtype: Any) -> NDArray[Any]:
    """A C-contiguous read-only array of that type; copied only if the type or layout differs."""
    result = np.ascontiguousarray(array, dtype=dtype)
    if result is array and result.flags.writeable:
        result = result.view()
    result.flags.writeable = False
    return result


def pack_mask(mask: NDArray[Any]) -> MaskWords:
    """Pack a mask (h, w), non-zero = body, into words (h, ceil(w / 64)).

    Column u is bit ``u % 64`` (least significant first) of word ``u // 64``; padding bits are 0.
    """
    height, width = mask.shape
    packed = np.zeros((height, (width + 63) // 64 * 8), dtype=np.uint8)
    bits = np.packbits(mask != 0, axis=1, bitorder="little")
    packed[:, : bits.shape[1]] = bits
    return packed.view("<u8").astype(np.uint64, copy=False)


def unpack_mask(words: MaskWords, width: int) -> NDArray[np.bool_]:
    """The mask (h, width) that `pack_mask` packed."""
    raw = np.ascontiguousarray(words, dtype="<u8").view(np.uint8)
    return np.unpackbits(raw, axis=1, count=width, bitorder="little").astype(np.bool_)


@dataclass(frozen=True, eq=False)
class Observation:
    """What one camera's image says about the body, in that camera's own (distorted) pixels.

    A pixel is person, background or undecided: it differs from the background as a shadow on it
    would. Undecided pixels count neither way.

    Attributes:
        camera: the camera's name.
        stamp_ns: capture time.
        size_px: (width, height) of the full frame.
        offset_px: (u, v) of the region's top left pixel in the full frame.
        mask_words: (h, ceil(w / 64)) uint64, the silhouette (person) packed as `pack_mask` does.
        edges: (h, w) uint8, edge strength M = value / 255, in the same region.
        undecided_words: the undecided pixels, packed likewise; none if left out. No pixel is
            person and undecided.
    """

    camera: str
    stamp_ns: int
    size_px: tuple[int, int]
    offset_px: tuple[int, int]
    mask_words: MaskWords
    edges: NDArray[np.uint8]
    undecided_words: MaskWords | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "mask_words", locked(self.mask_words, np.uint64))
        if self.undecided_words is not None:
            words = locked(self.undecided_words, np.uint64)
            # None stands for none, so that equal evidence is equal and costs nothing.
            object.__setattr__(self, "undecided_words", words if words.any() else None)
            if words.shape != self.mask_words.shape or (words & self.mask_words).any():
                raise ImageError(
                    f"{self.camera}: undecided words {words.shape} beside mask words "
                    f"{self.mask_words.shape}, expected the same shape and no pixel in both"
                )
        object.__setattr__(self, "edges", locked(self.edges, np.uint8))
        if self.edges.ndim != 2 or self.mask_words.shape != (self.height, (self.width + 63) // 64):
            raise ImageError(
                f"{self.camera}: observation holds edges {self.edges.shape} and mask words "
                f"{self.mask_words.shape}, expected (h, w) and (h, ceil(w / 64))"
            )
        (full_w, full_h), (u, v) = self.size_px, self.offset_px
        if u < 0 or v < 0 or u + self.width > full_w or v + self.height > full_h:
            raise ImageError(
                f"{self.camera}: region {self.width}x{self.height} at ({u}, {v}) does not lie "
                f"inside the frame of {full_w}x{full_h} px"
            )

    @property
    def width(self) -> int:
        """Width of the region in px."""
        return int(self.edges.shape[1])

    @property
    def height(self) -> int:
        """Height of the region in px."""
        return int(self.edges.shape[0])

    @property
    def mask(self) -> NDArray[np.bool_]:
        """The silhouette of the region, unpacked: (h, w)."""
        return unpack_mask(self.mask_words, self.width)

    @property
    def undecided(self) -> NDArray[np.bool_] | None:
        """The undecided pixels of the region, unpacked: (h, w); None if there are none."""
        if self.undecided_words is None:
            return None
        return unpack_mask(self.undecided_words, self.width)

    @property
    def not_background(self) -> NDArray[np.bool_]:
        """The pixels of the region that are person or undecided, unpacked: (h, w)."""
        words = self.mask_words
        if self.undecided_words is not None:
            words = words | self.undecided_words
        return unpack_mask(words, self.width)

    def in_full_frame(self, part: NDArray[Any]) -> NDArray[Any]:
        """An array (h, w) of the region as one of the full frame, 0 outside the region.

        The very same if the region is the full frame.
        """
        width, height = self.size_px
        if part.shape == (height, width):
            return part
        u, v = self.offset_px
        frame = np.zeros((height, width), dtype=part.dtype)
        frame[v : v + self.height, u : u + self.width] = part
        return frame

    def words_in_full_frame(self, words: MaskWords) -> MaskWords:
        """As `in_full_frame`, of a packed mask of the region."""
        if self.edges.shape == self.size_px[::-1]:
            return words
        return pack_mask(self.in_full_frame(unpack_mask(words, self.width)))

    @classmethod
    def from_mask(
        cls,
        camera: str,
        stamp_ns: int,
        mask: NDArray[Any],
        edges: NDArray[np.uint8],
        *,
        undecided: NDArray[Any] | None = None,
        size_px: tuple[int, int] | None = None,
        offset_px: tuple[int, int] = (0, 0),
    ) -> "Observation":
        """Build from a mask (h, w), non-zero = person; the region is the full frame unless given.

        Args:
            undecided: (h, w), non-zero = undecided; none if left out.
        """
        size = size_px or (int(mask.shape[1]), int(mask.shape[0]))
        words = None if undecided is None else pack_mask(undecided)
        return cls(camera, stamp_ns, size, offset_px, pack_mask(mask), edges, words)

    def with_masks(self, mask: NDArray[Any], undecided: NDArray[Any] | None) -> "Observation":
        """The same view with other silhouette and undecided pixels, (h, w) of the region."""
        words = None if undecided is None else pack_mask(undecided)
        return replace(self, mask_words=pack_mask(mask), undecided_words=words)


@dataclass(frozen=True, eq=False)
class Comparison:
    """What a search compares with the evidence: for a pose of p parameters and a body of c cones.

    Attributes:
        active: (d,) indices of the parameters that vary.
        centre: (p,) pose that the other parameters stay at.
        silhouette_weight, edge_weight: weights of f_s and f_e.
        silhouette_cones, edge_cones: (c,) cones that each term uses.

    Raises:
        SearchError: the centre is no pose, or an active parameter is not one of it.
    """

    active: NDArray[np.int64]
    centre: NDArray[np.float64]
    silhouette_weight: float
    edge_weight: float
    silhouette_cones: NDArray[np.bool_]
    edge_cones: NDArray[np.bool_]

    def __post_init__(self) -> None:
        for name, dtype in (
            ("active", np.int64),
            ("centre", np.float64),
            ("silhouette_cones", np.bool_),
            ("edge_cones", np.bool_),
        ):
            object.__setattr__(self, name, locked(getattr(self, name), dtype))
        if self.centre.ndim != 1:
            raise SearchError(f"comparison: centre is {self.centre.shape}, expected (p,)")
        if self.active.size == 0 or self.active.min() < 0 or self.active.max() >= self.centre.size:
            raise SearchError(
                f"comparison: active parameters are {self.active.tolist()}, expected some of "
                f"0..{self.centre.size - 1}"
            )

    @classmethod
    def whole(
        cls,
        centre: NDArray[np.float64],
        cones: int,
        *,
        silhouette_weight: float = 1.0,
        edge_weight: float = 0.0,
    ) -> "Comparison":
        """All parameters of a pose (p,) vary, and both terms use all cones of the body."""
        every = np.ones(cones, dtype=np.bool_)
        active = np.arange(len(centre))
        return cls(active, centre, silhouette_weight, edge_weight, every, every)


@dataclass(frozen=True, eq=False)
class SearchPlan:
    """How a search for a pose of p parameters proceeds.

    Attributes:
        algorithm: registered name of the optimiser, or 'contour' for contour refinement.
        sigma: (p,) standard deviation of the first sample in m or rad; only the active ones are
            read. For 'contour' that of the prior about the centre.
        particles: particles per iteration; 0 for 'contour'.
        iterations: iterations, of a swarm the initial sample being the first.
        min_improvement: where stages compete, a result is taken if f rises by more than this.
        options: the algorithm's own settings by name.

    Raises:
        SearchError: nothing to spend.
    """

    algorithm: str
    sigma: NDArray[np.float64]
    particles: int
    iterations: int
    min_improvement: float = 0.0
    options: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "sigma", locked(self.sigma, np.float64))
        if self.particles < (0 if self.algorithm == CONTOUR else 1) or self.iterations < 1:
            raise SearchError(
                f"{self.algorithm}: {self.particles} particles x {self.iterations} iterations, "
                "expected at least 1 of each"
            )

    @property
    def evaluations(self) -> int:
        """Evaluations that the search spends."""
        return self.particles * self.iterations


@dataclass(frozen=True, eq=False)
class Stage:
    """One search of a frame.

    Attributes:
        name: distinct within a frame; keys the random draws.
        comparison: what is compared; its centre is where the search starts.
        plan: how it is searched.

    Raises:
        SearchError: the two are of poses of another size.
    """

    name: str
    comparison: Comparison
    plan: SearchPlan

    def __post_init__(self) -> None:
        centre, sigma = self.comparison.centre, self.plan.sigma
        if sigma.shape != centre.shape:
            raise SearchError(
                f"stage {self.name}: centre {centre.shape} and sigma {sigma.shape} "
                "must be (p,) both"
            )

    def centred(self, pose: NDArray[np.float64]) -> "Stage":
        """The same stage from another pose (p,)."""
        return replace(self, comparison=replace(self.comparison, centre=pose))

    def planned(self, **changes: Any) -> "Stage":
        """The same stage with attributes of its plan changed."""
        return replace(self, plan=replace(self.plan, **changes))


class TrackState(Enum):
    """Where the tracker stands."""

    SEARCHING = "SEARCHING"
    TRACKING = "TRACKING"
    LOST = "LOST"


@dataclass(frozen=True)
class LimbState:
    """How well one limb is tracked.

    Attributes:
        state: TRACKING or LOST.
        inside_fraction: fraction of the limb's axis inside the silhouettes, mean over the views;
            NaN if it lies outside all frames.
        particle_sd_ratio: standard deviation of the swarm's particles after the last iteration
            over that of the first sample; NaN without a swarm.
    """

    state: TrackState
    inside_fraction: float
    particle_sd_ratio: float


@dataclass(frozen=True, eq=False)
class Confidence:
    """How sure a pose of p parameters is: standard deviations, in m and rad.

    Attributes:
        pose_sd: (p,) of each parameter.
        markers_sd_m: (15, 3) of each marker, along the world's axes.
        root_covariance: (6, 6) of the root frame: x, y, z, and small turns about the world's x, y
            and z axis.
    """

    pose_sd: NDArray[np.float64]
    markers_sd_m: NDArray[np.float64]
    root_covariance: NDArray[np.float64]

    def __post_init__(self) -> None:
        for name in ("pose_sd", "markers_sd_m", "root_covariance"):
            object.__setattr__(self, name, locked(getattr(self, name), np.float64))


@dataclass(frozen=True, eq=False)
class TrackResult:
    """What `Tracker.step` found in one set of images.

    Attributes:
        stamp_ns: time of the images.
        state: state after this frame.
        pose: (p,) parameters in m and rad, or None when there is no estimate.
        markers_m: (15, 3) marker positions, world frame, or None.
        fitness: f = f_s + f_e in [0, 2] of the estimate (NaN without one).
        iou: per camera, overlap (IoU) of the silhouette and the projected body.
        evaluations: evaluations of the objective that the swarms spent on this frame.
        refinements: iterations of contour refinement spent on this frame.
        observations: the evidence each camera gave.
        warnings: what the user should know about this frame, one line each.
        confidence: how sure the pose is, None without contour refinement.
        limbs: per limb, how well it is tracked; empty without an estimate.
        exposure: per camera whose image came, its brightness relative to its background's, by
            channel.
    """

    stamp_ns: int
    state: TrackState
    pose: NDArray[np.float64] | None
    markers_m: NDArray[np.float64] | None
    fitness: float
    iou: Mapping[str, float]
    evaluations: int
    refinements: int = 0
    observations: Mapping[str, Observation] = field(default_factory=dict, repr=False)
    warnings: tuple[str, ...] = ()
    confidence: Confidence | None = None
    limbs: Mapping[str, LimbState] = field(default_factory=dict)
    exposure: Mapping[str, tuple[float, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("pose", "markers_m"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, locked(value, np.float64))
