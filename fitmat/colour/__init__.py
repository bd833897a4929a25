"""Colour: what an eye makes of light: observers, illuminants, spaces of colour, and differences in them.

It knows no material, no measurement and no picture.
"""
