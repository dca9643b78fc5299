"""A result in the formats of other programs, one module per format.

Every writer takes a `ResultReader` and writes a chunk at a time. Axes and origin as in the TRC.
"""
