"""Identifiability: which parameters the angles determine, by profiles, ridges and trade-offs.

It proposes no measurement.
"""
