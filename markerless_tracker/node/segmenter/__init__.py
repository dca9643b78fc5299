"""The node `segmenter`: one camera's images in, packed evidence out.

`wire` is the form of that evidence on topics, which the tracker reads.
"""
