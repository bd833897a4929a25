"""Models: what light does at a surface; one model, one file, one page of manual.

They are written for one pair of directions, and know no measurement but its instrument.
"""
