"""Recordings in the layouts of public data sets and of other tools.

Each module reads one layout; `numbers` reads their text files.
"""
