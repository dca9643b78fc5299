"""Full-body pose tracking from several calibrated cameras, with particle swarms."""

__version__ = "0.1.0"
