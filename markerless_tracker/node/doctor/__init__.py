"""Listening to cameras for the verb `doctor`.

`listen` receives their images for some seconds; `checks.stream` judges them.
"""
