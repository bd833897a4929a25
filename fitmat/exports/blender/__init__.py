"""Blender: the closest Principled BSDF as a script, Cycles' formulas as a model, and Cycles itself where there is one.

It opens no window and leaves no file of Blender's.
"""
