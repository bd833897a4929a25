"""Klems matrices: a material as the reflection of a surface in LBNL's XML, as WINDOW, EnergyPlus and Radiance read it.

Nothing is fitted; a value is the mean over its two patches, which are 10 to 20 degrees wide. Both sides are the same.
"""

import dataclasses
from collections.abc import Sequence
from xml.sax.saxutils import escape

import numpy as np
from jaxtyping import Float

from fitmat.exports import radiance
from fitmat.exports.material import Chosen
from fitmat.exports.verification import Difference, compared, directions, exact
from fitmat.maths.directions import from_angles
from fitmat.measurements.samples import default_channels
from fitmat.models.base import Sum, evaluate
from fitmat.models.values import at

PATCHES = (1, 8, 16, 20, 24, 24, 24, 16, 12)
LIMITS = (0, 5, *range(15, 76, 10), 90)
RINGS = tuple(zip(LIMITS[:-1], LIMITS[1:], PATCHES, strict=True))
"""Of the basis "LBNL/Klems Full": zenith angles in degrees, from and to, and how many patches a ring has."""

COUNT = sum(PATCHES)

SAMPLES = 512
"""Pairs of directions in each pair of patches, evenly in the cosines squared and azimuths."""

NARROW = 0.09
"""Slope below which a highlight is narrower than the smallest patch, tan 5 degrees."""

EVERY = 4
"""Of the pairs of directions at which Radiance is asked."""

FILE = """<?xml version="1.0" encoding="UTF-8"?>
<!--
{comment}
-->
<WindowElement xmlns="http://windows.lbl.gov">
<WindowElementType>System</WindowElementType>
<FileType>BSDF</FileType>
<Optical>
<Layer>
<Material>
<Name>{name}</Name>
<Manufacturer>fitmat</Manufacturer>
<Thickness unit="Meter">0</Thickness>
<Width unit="Meter">1</Width>
<Height unit="Meter">1</Height>
<DeviceType>Other</DeviceType>
</Material>
<DataDefinition>
<IncidentDataStructure>Columns</IncidentDataStructure>
<AngleBasis>
<AngleBasisName>LBNL/Klems Full</AngleBasisName>
{basis}</AngleBasis>
</DataDefinition>
{sides}</Layer>
</Optical>
</WindowElement>
"""

BLOCK = """<AngleBasisBlock>
<Theta>{theta}</Theta>
<nPhis>{patches}</nPhis>
<ThetaBounds>
<LowerTheta>{low}</LowerTheta>
<UpperTheta>{high}</UpperTheta>
</ThetaBounds>
</AngleBasisBlock>
"""

SIDE = """<WavelengthData>
<LayerNumber>System</LayerNumber>
<Wavelength unit="Integral">Visible</Wavelength>
<SourceSpectrum>CIE Illuminant D65 1nm.ssp</SourceSpectrum>
<DetectorSpectrum>ASTM E308 1931 Y.dsp</DetectorSpectrum>
<WavelengthDataBlock>
<WavelengthDataDirection>Reflection {side}</WavelengthDataDirection>
<ColumnAngleBasis>LBNL/Klems Full</ColumnAngleBasis>
<RowAngleBasis>LBNL/Klems Full</RowAngleBasis>
<ScatteringDataType>BRDF</ScatteringDataType>
<ScatteringData>
{values}
</ScatteringData>
</WavelengthDataBlock>
</WavelengthData>
"""


def translated(chosen: Chosen) -> Float[np.ndarray, "c o i"]:
    """Means of the BRDF over pairs of patches in sr⁻¹, (c, 145, 145): a matrix a channel, a row an outgoing patch.

    The azimuth of an incident patch is that in which light travels, so that the mirror direction has its own number.
    """
    steps = np.array([0.8566748838545029, 0.733891856627126, 0.6287067210378087, 0.5385972572236101])
    u = (0.5 + np.arange(SAMPLES)[:, None] * steps) % 1.0  # Roberts' sequence in four dimensions
    light, eye = _patches(u[:, :2]), _patches(u[:, 2:])
    light = light * [-1.0, -1.0, 1.0]
    columns = []
    for wi in light:
        value = at(chosen.model, np.tile(wi, (COUNT, 1)), eye.reshape(-1, 3))
        columns.append(value.reshape(COUNT, SAMPLES, -1).mean(axis=1))
    found = np.moveaxis(np.array(columns), (0, 1, 2), (2, 1, 0))
    lobes = chosen.model.lobes if isinstance(chosen.model, Sum) else (chosen.model,)
    one_way = any("reciprocal" in lobe.breaks for lobe in lobes)
    return found if one_way else 0.5 * (found + np.swapaxes(found, 1, 2))


def _patches(u: Float[np.ndarray, "s 2"]) -> Float[np.ndarray, "k s 3"]:
    """Directions in each patch, even in projected solid angle."""
    every = []
    for low, high, patches in RINGS:
        ends = np.cos(np.deg2rad([low, high])) ** 2
        cos = np.sqrt(ends[0] + (ends[1] - ends[0]) * u[:, 0])
        for k in range(patches):
            every.append(from_angles(np.arccos(cos), 2.0 * np.pi * (k + u[:, 1] - 0.5) / patches))
    return np.array(every)


def notes(chosen: Chosen, matrices: Float[np.ndarray, "c o i"]) -> list[str]:
    """What the patches are too coarse for."""
    del matrices
    width = float(chosen.model.width())
    if width >= NARROW:
        return []
    return [
        f"The highlight of {chosen.model.name} (slope {width:.2g}) is narrower than Klems's patches: it is spread over "
        "those that it meets."
    ]


def texts(name: str, header: Sequence[str], matrices: Float[np.ndarray, "c o i"]) -> dict[str, str]:
    """File names → texts: one file, or one for each channel."""
    if len(matrices) == 1:
        return {f"{name}.xml": xml(name, header, matrices[0])}
    labels = default_channels(len(matrices))
    return {f"{name}-{label}.xml": xml(name, header, one) for label, one in zip(labels, matrices, strict=True)}


def xml(name: str, header: Sequence[str], matrix: Float[np.ndarray, "o i"]) -> str:
    """One channel, the same on both sides; what there is to say as a comment."""
    comment = "\n".join(line.replace("--", "-\\u002d") for line in header)
    values = "\n".join(", ".join(f"{x:.6g}" for x in row) + "," for row in matrix)
    basis = "".join(
        BLOCK.format(theta=0 if low == 0 else (low + high) / 2, patches=patches, low=low, high=high)
        for low, high, patches in RINGS
    )
    sides = "".join(SIDE.format(side=side, values=values) for side in ("Front", "Back"))
    plain = escape(name).encode("ascii", "xmlcharrefreplace").decode("ascii")
    return FILE.format(comment=comment, name=plain, basis=basis, sides=sides)


def difference(chosen: Chosen, matrices: Float[np.ndarray, "c o i"]) -> Difference | None:
    """How far Radiance's values of the first channel's file are from the model's; None without rtrace."""
    if radiance.program() is None:
        return None
    wi, wo = (w[::EVERY] for w in directions())
    values, executor = looked_up(matrices[0], *exact(wi, wo))
    found = compared(values[:, :1], evaluate(chosen.model, *exact(wi, wo))[:, :1], wi, wo, executor)
    return dataclasses.replace(found, over="grazing and mirror peak included; between patches nothing is interpolated")


def looked_up(
    matrix: Float[np.ndarray, "o i"], wi: Float[np.ndarray, "n 3"], wo: Float[np.ndarray, "n 3"]
) -> tuple[Float[np.ndarray, "n 3"], str]:
    """What rtrace makes of a file; y of the matrix is y of a facet."""

    def words(name: str, frame: Float[np.ndarray, "3 3"]) -> str:
        up = " ".join(f"{x:.17g}" for x in frame[1])
        return f"void BSDF {name}\n6 0 material.xml {up} .\n0\n0\n"

    return radiance.run(words, wi, wo, beside={"material.xml": xml("material", (), matrix)})
