"""One HTML page about one or several results: charts, tables, film.

The page is self-contained: it opens from disk and loads nothing over the network.
"""
