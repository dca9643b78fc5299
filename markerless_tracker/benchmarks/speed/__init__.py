"""Computing time of each part, and its ratio to a fixed reference."""
