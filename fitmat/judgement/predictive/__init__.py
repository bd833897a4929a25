"""Predictive checks: whether a fitted model can make data like the measured ones.

They compare no models.
"""
