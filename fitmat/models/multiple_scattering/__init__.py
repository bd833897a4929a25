"""Multiple scattering on Smith micro-surfaces, by random walks and by position-free paths.

References with standard errors; nothing here is fitted.
"""
