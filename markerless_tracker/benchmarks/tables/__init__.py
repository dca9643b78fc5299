"""Tables of accuracy: configurations, frame rates and seeds on recordings with a truth.

Runs in several processes or on a Dask cluster.
"""
