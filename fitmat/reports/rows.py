"""Rows: the numbers of one model as text, for the page and the terminal alike.

It computes nothing: every number comes from the findings.
"""

import math

import numpy as np

from fitmat.fitting.quantities import UNDETERMINED
from fitmat.studies.findings import Findings
from fitmat.text import interval, visible, with_error


def parameter_rows(found: Findings) -> list[dict[str, str]]:
    """One line per reported number, as text: name, symbol, value, interval, remark, what it means.

    What the data do not determine has its interval, but no standard deviation: the draws fill the range allowed.
    """
    channels = found.fit.measurements.channels
    result = []
    for kind, quantities in (("fitted", found.parameters), ("follows", found.derived)):
        for q in quantities:
            for k in range(len(q.value)):
                low, high = q.ci95[k]
                channel = f" {visible(channels[k])}" if q.per_channel and len(channels) > 1 else ""
                free = q.remarks[k] != "fixed" and np.isfinite(low) and np.isfinite(high)
                sd = math.nan if q.remarks[k] == UNDETERMINED else q.sd[k]
                result.append(
                    {
                        "kind": kind,
                        "name": q.name + channel,
                        "symbol": q.symbol,
                        "value": with_error(q.value[k], sd),
                        "interval": interval(low, high, sd) if free else "",
                        "unit": "" if q.unit == "1" else q.unit,
                        "remark": q.remarks[k],
                        "doc": q.doc,
                    }
                )
    return result


def prior_rows(found: Findings) -> list[dict[str, str]]:
    """One line per fitted parameter: its prior, what the data made of it, and how much narrower that is."""
    after = {row["name"]: row["interval"] for row in parameter_rows(found) if row["kind"] == "fitted"}
    return [
        {
            "name": learnt.name,
            "symbol": learnt.symbol,
            "prior": learnt.prior,
            "posterior": after[learnt.name],
            "narrower": f"{learnt.narrower:.3g}",
        }
        for learnt in found.learnt
    ]
