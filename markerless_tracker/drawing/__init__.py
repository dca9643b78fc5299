"""A body drawn over an image: outlines, silhouettes, overlays, evidence, contact sheets."""

from markerless_tracker.drawing.evidence import draw_evidence
from markerless_tracker.drawing.outline import outlines, silhouette
from markerless_tracker.drawing.overlay import draw_overlay
from markerless_tracker.drawing.sheet import overlay_sheet

__all__ = ["draw_evidence", "draw_overlay", "outlines", "overlay_sheet", "silhouette"]
