"""Measurements: what was measured, with which instrument and noise, and how any file becomes that one noun.

It knows no model and fits nothing.
"""
