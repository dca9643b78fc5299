"""What commands show on standard error while they work: progress bars, notices of a run.

Nothing but warnings is shown where standard error is no terminal.
"""
