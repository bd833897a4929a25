"""Batches: many files, each a study of its own, as rows of one table.

They fit, judge and draw nothing themselves.
"""
