"""Background models: what each pixel shows without the person.

Learned from empty scenes or from recordings with people in them; stored, scaled, adapted.
"""
