"""Fitting: from measurements and a model to the best parameters, their information, and a named outcome.

It draws no posterior and judges no model.
"""
