"""State of each limb, and the search for a limb that was lost.

The rest of the body stays.
"""
