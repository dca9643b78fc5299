"""Writing bags."""

from markerless_tracker.bags.write import COMPRESSIONS, BagSummary, write_bag

__all__ = ["COMPRESSIONS", "BagSummary", "write_bag"]
