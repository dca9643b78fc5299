"""Comparison of a result with references of other laboratories: alignment, the field's measures.

What `evaluate` reports beside `results.score`.
"""
