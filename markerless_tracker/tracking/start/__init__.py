"""Automatic start: position, heading, stature and pose of a person in the views."""
