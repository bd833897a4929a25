"""Streamed: the fit of a file too large for memory, by passes over its blocks.

It looks for no other optimum than the one that a part of the rows shows.
"""
