__version__: str

# Measurements
from .measurements.reader import read as read
from .measurements.joining import join as join
from .measurements.writing import write as write
from .measurements.samples import from_arrays as from_arrays
from .measurements.samples import Measurements as Measurements
from .measurements.instrument import Instrument as Instrument
from .judgement.examination.examining import examine as examine
from .models.simulation import simulate as simulate

# Models
from .models.registry import model as model
from .judgement.choice.choice import every_model as every_model
from .maths.directions import directions as directions
from .models.base import evaluate as evaluate
from .models.albedo import albedo as albedo
from .models.in_rgb import fresnel_in_rgb as fresnel_in_rgb
from .colour.metamerism import metamerism as metamerism
from .models.multiple_scattering.surface import Surface as Surface
from .models.multiple_scattering.random_walk import evaluate_walk as evaluate_walk
from .models.multiple_scattering.random_walk import albedo_walk as albedo_walk
from .models.interface import transmittance as transmittance
from .models.interface import evaluate_interface as evaluate_interface
from .models.interface import albedo_interface as albedo_interface
from .models.multiple_scattering.position_free import evaluate_slab as evaluate_slab

# Fitting
from .fitting.fitting import fit as fit
from .fitting.result import Fit as Fit
from .fitting.many.fitting_many import fit_many as fit_many
from .fitting.many.fits import Fits as Fits
from .fitting.indices import indices as indices

# Uncertainty
from .uncertainty.laplace import laplace as laplace
from .uncertainty.chains import sample as sample
from .uncertainty.posterior import Posterior as Posterior

# Judgement
from .judgement.identifiability.verdicts import identify as identify
from .judgement.choice.choice import choose as choose
from .judgement.predictive.check import check_predictions as check_predictions
from .uncertainty.second_sampler import check_posterior as check_posterior
from .judgement.calibration import calibrate as calibrate
from .judgement.design.design import next_angles as next_angles
from .judgement.laboratories.comparing import compare_laboratories as compare_laboratories

# Match
from .match.match import compare as compare
from .match.match import Match as Match
from .match.imitation import imitate as imitate

# Study
from .studies.study import study as study
from .studies.study import Study as Study
from .studies.result import load as load
from .studies.colours import colour_of as colour_of

# Batch
from .batches.batch import batch as batch

# Export
from .exports.export import export as export

# Report
from .reports.page import report as report
from .reports import plot as plot
from .reports.portrait import render as render
from .errors import FitmatError as FitmatError
