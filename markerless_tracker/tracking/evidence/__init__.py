"""From views to the evidence of the tracked person.

Segments images around the predicted body, selects components, leaves out unusable views.
"""
