"""Studies: the whole story of one file, computed once: fit, sample, match, judge; and its record.

What people see of it is made elsewhere.
"""
