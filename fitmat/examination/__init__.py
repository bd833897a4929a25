"""Examination: what a file of measurements holds and can tell, before any fit.

It fits nothing and changes nothing.
"""

from fitmat.judgement.examination.examining import Examination as Examination
from fitmat.judgement.examination.examining import examine as examine
