"""Pictures, films, Rerun recordings and HTML pages of a run."""
