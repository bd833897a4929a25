"""Batches: many files, each a study of its own, as rows of one table; and textures, point by point.

They fit, judge and draw nothing themselves.
"""
