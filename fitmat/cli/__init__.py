"""Command line: parse, one library call, print.

Everything that it can do, the library can do.
"""
