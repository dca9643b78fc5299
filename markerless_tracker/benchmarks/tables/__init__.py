"""Tables of accuracy: configurations, frame rates and seeds on recordings with reference markers.

The runs are spread over processes or over a Dask cluster.
"""
