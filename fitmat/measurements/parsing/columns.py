"""Columns: which column of a table holds which quantity, by name, by alias, or as its user says.

A column that could be two things, or two columns that could be one, are refused with the remedy.
"""

import dataclasses
from collections.abc import Iterable, Mapping

from fitmat.errors import ReadError
from fitmat.measurements.options import ANGLES, ELEVATIONS
from fitmat.measurements.parsing import units
from fitmat.measurements.parsing.contents import listed, shown
from fitmat.measurements.parsing.names import ALIASES, BESIDE, VALUES, Role, role, roles_of
from fitmat.measurements.parsing.table import Table
from fitmat.measurements.quantity import QUANTITIES

EXAMPLE = 'columns="theta_i=Zenith,theta_o=3" (--columns)'

_RIVALS = (VALUES, *ELEVATIONS.items(), ("wavelength", "channel"), ("phi", "phi_i"), ("phi", "phi_o"), ("sigma",))


MARKS = ("valid", "invalid", "wavelength", "channel")


@dataclasses.dataclass(frozen=True)
class Columns:
    """Where to find what: numbers are column positions from 0.

    Attributes:
        angles: theta_i, theta_o and, where given, phi or phi_i and phi_o.
        values: Channel → column of the quantity.
        sigmas: Channel → column of its σ; empty where there is none.
        references: Channel → column of the reading of a white panel in the same geometry; empty where there is none.
        reference_sigmas: Channel → column of that reading's σ.
        inferred: Channel → column that is not 0 where the value was inferred, not measured; empty where there is none.
        marks: valid, invalid, wavelength, channel, where given.
        quantity: One of `QUANTITIES`, or "signal", which becomes "panel_ratio" by its reference.
        unused: The columns that play no part.
    """

    angles: dict[str, int]
    values: dict[str, int]
    sigmas: dict[str, int]
    references: dict[str, int]
    reference_sigmas: dict[str, int]
    inferred: dict[str, int]
    marks: dict[str, int]
    quantity: str
    unused: tuple[int, ...]


def assign(table: Table, columns: str | Mapping[str, str | int] | None, quantity: str | None) -> Columns:
    """Find the columns that a BRDF needs: what the user said first, then what the header says.

    Raises:
        ReadError: a column is unknown, missing, there twice, or does not say what it holds.
    """
    found = roles(table, columns)
    angles = {k: found[Role(k)] for k in ANGLES if Role(k) in found}
    _refuse_angles(table, angles)
    kind, quantity = _quantity(table, found, quantity)
    values = {role.channel: column for role, column in found.items() if role.kind == kind}
    marks = {k: found[Role(k)] for k in MARKS if Role(k) in found}
    if len(values) > 1 and "" in values:
        raise ReadError(f"{table.source}: {kind} and {kind}_… columns, expected one kind. {_choose(kind)}")
    if len(marks.keys() & {"wavelength", "channel"}) + any(values) > 1:
        expected = "expected one channel per column, or one wavelength or channel column"
        raise ReadError(f"{table.source}: channels named in two ways, {expected}. Remove one of them.")
    sigmas, references, spreads, inferred, known = (_beside(table, kind, found, values) for kind in BESIDE)
    _refuse_unreferenced(table, quantity, references)
    groups = (angles, values, sigmas, references, spreads, inferred, known, marks)
    used = {c for group in groups for c in group.values()}
    unused = tuple(c for c in range(len(table.names)) if c not in used)
    return Columns(angles, values, sigmas, references, spreads, inferred, marks, quantity, unused)


def roles(table: Table, columns: str | Mapping[str, str | int] | None) -> dict[Role, int]:
    """What each column holds, by the user's word, then by the header; positions from 0."""
    said = _said(table, columns)
    return said | _recognised(table, said)


def _said(table: Table, columns: str | Mapping[str, str | int] | None) -> dict[Role, int]:
    """The user's mapping, our name → theirs, as roles and positions."""
    found: dict[Role, int] = {}
    for ours, theirs in _pairs(table, columns):
        mine = role(ours, any_channel=True)
        if mine is None:
            known = ", ".join(ALIASES)
            raise ReadError(f"{table.source}: columns maps {ours!r}, expected one of {known}. Write ours=theirs.")
        column = _position(table, theirs)
        if mine in found or column in found.values():
            raise ReadError(f"{table.source}: columns maps {ours} or {theirs!r} twice, expected once. Remove one.")
        found[mine] = column
    return found


def _pairs(table: Table, columns: str | Mapping[str, str | int] | None) -> Iterable[tuple[str, str | int]]:
    if columns is None:
        return ()
    if isinstance(columns, Mapping):
        return tuple((str(ours), theirs) for ours, theirs in columns.items())
    parts = [part.partition("=") for part in str(columns).split(",")]
    if not all(ours.strip() and theirs.strip() for ours, _, theirs in parts):
        raise ReadError(f"{table.source}: columns = {columns!r}, expected pairs ours=theirs. Write {EXAMPLE}.")
    return tuple((ours, theirs.strip()) for ours, _, theirs in parts)


def _position(table: Table, theirs: str | int) -> int:
    """The column of that name, or, where no column has it, of that number from 1."""
    name = str(theirs).strip()
    named = [(k, other) for k, other in enumerate(table.names) if other]
    same = [k for k, other in named if other == name]
    same = same or [k for k, other in named if other.lower() == name.lower()]
    same = same or [k for k, other in named if units.split(other)[0].lower() == name.lower()]
    if len(same) > 1:
        expected = f"expected one. Say which by its number, 1 to {len(table.names)}."
        raise ReadError(f"{table.source}: {len(same)} columns are named {name}, {expected}")
    if same:
        return same[0]
    if not name.isdecimal():
        raise ReadError(f"{table.source}: no column {name!r}; {_found(table)}. Correct columns= (--columns).")
    if not 1 <= int(name) <= len(table.names):
        expected = f"expected 1 to {len(table.names)}. Correct columns= (--columns)."
        raise ReadError(f"{table.source}: no column {name}, {expected}")
    return int(name) - 1


def _recognised(table: Table, said: Mapping[Role, int]) -> dict[Role, int]:
    """The header's own roles, but for what the user's mapping replaces."""
    kinds = {mine.kind for mine in said}
    replaced = {rival for group in _RIVALS if kinds & {*group} for rival in group}
    found: dict[Role, int] = {}
    for column, mine in enumerate(roles_of(table.names, valued=bool(kinds & {*VALUES}))):
        if mine is None and column not in said.values():
            _refuse_foreign_unit(table, table.names[column])
        if mine is None or mine in said or mine.kind in replaced or column in said.values():
            continue
        if mine in found:
            both = f"columns {found[mine] + 1} and {column + 1} ({table.label(found[mine])}, {table.label(column)})"
            raise ReadError(f"{table.source}: {both} are both {mine}, expected one. {_choose(str(mine))}")
        found[mine] = column
    return found


def _refuse_foreign_unit(table: Table, name: str) -> None:
    """Stop at an angle or a wavelength in a unit that is not known; it would count as not there."""
    behind = units.bracket(name)
    if behind is not None and (known := role(behind[0])) and known.kind in (*ANGLES, "wavelength"):
        expected = "nm or µm" if known.kind == "wavelength" else "deg, rad or gon"
        got = f"the column {shown(name)} is in {shown(behind[1]) or 'no unit'}, expected {expected}"
        raise ReadError(f"{table.source}: {got}. Convert it, or say what it is: {EXAMPLE}.")


def _refuse_angles(table: Table, angles: Mapping[str, int]) -> None:
    for zenith, elevation in ELEVATIONS.items():
        if {zenith, elevation} <= angles.keys():
            expected = f"expected one: {elevation} is 90° − {zenith}. {_choose(zenith)}"
            raise ReadError(f"{table.source}: {zenith} and {elevation}, {expected}")
    missing = [name for name, other in ELEVATIONS.items() if not {name, other} & angles.keys()]
    if missing:
        expected = " and ".join(f"{name} (or {', '.join(ALIASES[name][:4])}, …)" for name in missing)
        flag = missing[0].replace("_", "-")
        same = f"or, of one that is the same in every row, say it: --{flag} 30 (constants=)"
        raise ReadError(f"{table.source}: {_found(table)}, expected {expected}. Name them: {EXAMPLE}; {same}.")
    azimuths = angles.keys() & {"phi", "phi_i", "phi_o"}
    if "phi" in azimuths and len(azimuths) > 1:
        found = " and ".join(sorted(azimuths))
        raise ReadError(f"{table.source}: {found}, expected phi, or phi_i and phi_o. {_choose('phi')}")
    if len(azimuths & {"phi_i", "phi_o"}) == 1:
        (alone,) = azimuths
        which = table.names[angles[alone]] or angles[alone] + 1
        remedy = f'If it is the relative azimuth, pass columns="phi={which}" (--columns).'
        raise ReadError(f"{table.source}: {alone} alone, expected phi_i and phi_o. {remedy}")


def _quantity(table: Table, roles: Mapping[Role, int], quantity: str | None) -> tuple[str, str]:
    """The kind of the value columns and the quantity they hold."""
    kinds = [kind for kind in VALUES if any(mine.kind == kind for mine in roles)]
    choices = ", ".join(QUANTITIES)
    if not kinds:
        expected = f"expected a measured quantity: {choices}, or value"
        raise ReadError(f'{table.source}: {_found(table)}, {expected}. Name it: columns="brdf=3" (--columns).')
    if quantity in kinds:
        return quantity, quantity
    if quantity and "value" in kinds:
        return "value", quantity
    if quantity:
        got = f"quantity = {quantity}, but the column is named {kinds[0]}"
        raise ReadError(f'{table.source}: {got}, expected them to agree. Rename it: columns="{quantity}={kinds[0]}".')
    if len(kinds) > 1:
        raise ReadError(f"{table.source}: {' and '.join(kinds)} at once, expected one quantity. {_choose(kinds[0])}")
    if kinds == ["value"]:
        why = "They differ by π or cos θ_o, which a fit would absorb unseen, so fitmat refuses to guess"
        bands = [table.label(column) for mine, column in roles.items() if mine.channel]
        which = f"the columns {listed(bands)} do not say what they hold" if bands else ""
        got = f"{which or 'the column value does not say what it holds'}, expected {choices}"
        raise ReadError(f"{table.source}: {got}. {why}: pass quantity= (--quantity).")
    return kinds[0], kinds[0]


def _beside(table: Table, kind: str, roles: Mapping[Role, int], values: Iterable[str]) -> dict[str, int]:
    """One column of that kind per channel; a plain one serves every channel."""
    given = {mine.channel: column for mine, column in roles.items() if mine.kind == kind}
    if not given:
        return {}
    found = {channel: given.get(channel, given.get("", -1)) for channel in values}
    if -1 in found.values() or given.keys() - found.keys() - {""}:
        named, wanted = (", ".join(str(Role(kind, name)) for name in names) for names in (given, found))
        raise ReadError(f"{table.source}: {named} given, expected {wanted}. Name them alike, or give one plain {kind}.")
    return found


def _refuse_unreferenced(table: Table, quantity: str, references: Mapping[str, int]) -> None:
    if quantity == "signal" and not references:
        expected = "expected a column reference beside it: the reading of a white panel in the same geometry"
        remedy = (
            "Without one, say what the signal is proportional to, for example "
            '--columns "brdf_cos=signal" --unknown-scale.'
        )
        raise ReadError(f"{table.source}: signal alone, {expected}. {remedy}")
    if references and quantity != "signal":
        expected = "expected it beside signal only"
        raise ReadError(f"{table.source}: a column reference beside {quantity}, {expected}. Rename or remove it.")


def _found(table: Table) -> str:
    if any(table.names):
        return f"the columns are {listed(table.names)}"
    return f"no header line and {len(table.names)} columns"


def _choose(name: str) -> str:
    return f'Choose: columns="{name}=3", by name or by number (--columns).'
