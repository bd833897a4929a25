"""Flags of the command line by subject: what they are called, and what their help says.

No flag does anything here.
"""
