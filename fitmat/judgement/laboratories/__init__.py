"""Laboratories: several that measured one sample, whether they agree, and whose calibration is off.

They fit by `fitting` and invent no uncertainty.
"""
