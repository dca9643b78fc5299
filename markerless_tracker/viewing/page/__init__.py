"""One HTML page about a result or several: charts, tables, film.

Everything is in the page: it opens from disk and asks no network for anything.
"""
