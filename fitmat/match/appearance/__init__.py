"""Appearance: lit spheres of two models, and how different their colours look.

It knows no measurement.
"""
