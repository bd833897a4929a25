"""Exports: a material in the language of a renderer, executed there, and how far it is from the fit.

They fit nothing; what a target cannot hold is refused in a sentence.
"""
