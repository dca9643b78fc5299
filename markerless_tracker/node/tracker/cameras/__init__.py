"""The cameras of the tracker: their inputs, and the counts of each for `state`."""
