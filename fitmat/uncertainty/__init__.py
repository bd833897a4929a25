"""Uncertainty: the posterior of a fit, by Laplace, by chains, and by a second sampler that checks them.

It chooses no model and says nothing of whether the model is right.
"""
