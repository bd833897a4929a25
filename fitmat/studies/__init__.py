"""Studies: the whole story of one file, computed once: fit, sample, match, judge; its record, read back.

What people see of it is made elsewhere.
"""

DEFAULT_MODELS = ("lambert+blinn-phong", "lambert+ggx")
"""The empirical and the microfacet model of a study that names none."""
