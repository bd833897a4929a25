"""Choice: which of several models the data prefer, by what they leave over and by incidences that were left out.

It fits no model to all data and judges none alone.
"""
