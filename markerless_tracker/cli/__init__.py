"""The command ``markerless_tracker`` and its verbs, one module each."""
