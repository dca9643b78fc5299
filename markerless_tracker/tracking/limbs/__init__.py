"""State of each limb, and the searches for limbs and headings that were lost.

A search for a limb begins with the rest of the body held at the estimate.
"""
