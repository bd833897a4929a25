"""Examination: what a file of measurements holds and can tell, before any fit.

It fits nothing and draws no picture.
"""
