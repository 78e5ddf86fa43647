"""Rows of the tables beside the findings, while they are gathered run by run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

Rows = list[dict[str, Any]]


def table(columns: Mapping[str, Any]) -> Rows:
    """Return rows from columns of one length and single values."""
    n = max((len(value) for value in columns.values() if isinstance(value, np.ndarray)), default=0)
    return [{k: v[i] if isinstance(v, np.ndarray) else v for k, v in columns.items()} for i in range(n)]


def or_nan(value: float | None) -> float:
    """Return a number, NaN where there is none."""
    return math.nan if value is None else float(value)
