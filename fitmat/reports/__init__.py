"""Reports: the page, the terminal and the pictures of what was found.

They compute nothing: numbers come from a study.
"""
