"""Examination: what a file of measurements holds and can tell, before any fit.

It fits nothing and changes nothing.
"""

from fitmat.examination.examining import Examination as Examination
from fitmat.examination.examining import examine as examine
