"""Parsing: bytes to text, cells, tables, columns, angles and tensors; what several formats have in common.

It knows no format by name.
"""
