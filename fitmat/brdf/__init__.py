"""Reflectance models: one model, one file, one page of manual."""

from fitmat.brdf.base import AbstractBRDF as AbstractBRDF
from fitmat.brdf.base import evaluate as evaluate
from fitmat.brdf.base import evaluate_pairs as evaluate_pairs
from fitmat.brdf.base import padded_length as padded_length
from fitmat.brdf.noisy import LEAST_ABSOLUTE as LEAST_ABSOLUTE
from fitmat.brdf.noisy import Noisy as Noisy
from fitmat.brdf.registry import LOBES as LOBES
from fitmat.brdf.registry import lobe_names as lobe_names
from fitmat.brdf.registry import model as model
from fitmat.brdf.registry import normalised as normalised
from fitmat.brdf.seen import Seen as Seen
from fitmat.brdf.seen import surface as surface
