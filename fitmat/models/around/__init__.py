"""Around: what stands over or before a surface: coats, a tilted mount, an instrument, its noise.

Each is a model that holds another; none has a lobe of its own.
"""
