"""Progress bars and notices of a run, on standard error.

If standard error is no terminal, only warnings are shown.
"""
