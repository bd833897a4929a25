"""Judgement: whether a fit may be believed, what the data determine, which model they prefer, what to measure next.

It changes no fit and no draw.
"""
