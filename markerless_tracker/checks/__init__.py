"""Checks of a recording before tracking: step, background, light, views, calibration."""
