"""Maths: directions, rules of quadrature, warps and least squares, on which everything else stands.

It knows no material, no instrument and no file.
"""
