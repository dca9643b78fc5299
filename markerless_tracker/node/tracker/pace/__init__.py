"""How the worker keeps up with the images.

Evidence is made ahead; a worker that is late spends less on each set.
"""
