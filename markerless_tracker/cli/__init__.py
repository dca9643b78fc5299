"""The command ``markerless_tracker`` and its verbs, one module or folder each."""
