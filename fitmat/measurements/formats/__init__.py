"""Formats: one dialect of file, one module; each claims its files, reads them to a `Recording`, and may write them.

No format knows another.
"""
