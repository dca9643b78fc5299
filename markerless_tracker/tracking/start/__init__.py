"""Starting by itself: where somebody stands, which way, and in which pose."""
