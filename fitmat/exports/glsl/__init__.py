"""GLSL: a model as a function of a shader, the files around it, and a browser that runs it.

It looks for no closest material: what has no GLSL is refused.
"""
