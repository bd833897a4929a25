"""Match: how closely an empirical model reproduces a microfacet model, in BRDF error, in energy, to an eye.

It takes two posteriors as they are; it fits neither to the data again.
"""
