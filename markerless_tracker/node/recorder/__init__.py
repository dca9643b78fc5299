"""The recorder: topics of a running graph, as they are, into an MCAP bag.

Which topics, subscriptions to them, and the process.
"""
