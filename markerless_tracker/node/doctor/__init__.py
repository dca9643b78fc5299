"""Reception of cameras' images for the verb `doctor`.

`listen` receives them for some seconds; `checks.stream` evaluates them.
"""
