from .brdf import evaluate as evaluate
from .brdf import model as model
