"""Lobes: one way of scattering light, one file.

A lobe knows its formula and its parameters; names and sums of lobes are for the registry.
"""
