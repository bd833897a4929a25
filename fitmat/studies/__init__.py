"""Studies: the whole story of one file, computed once: fit, sample, match, judge; its record, read back.

What people see of it is made elsewhere.
"""
