"""Design: the next measurement that would tell most.

It measures nothing and refits nothing.
"""
