"""Tables from rows or from columns; one without rows keeps its columns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

Rows = list[dict[str, Any]]


def table(columns: Sequence[str], rows: Rows) -> pd.DataFrame:
    """Return a table of rows."""
    import pandas as pd

    return pd.DataFrame(rows, columns=list(columns))


def joined(columns: Sequence[str], parts: Sequence[dict[str, Any]]) -> pd.DataFrame:
    """Join tables given as columns of one length and single values; empty ones are left out."""
    import pandas as pd

    frames = [pd.DataFrame(part, columns=list(columns)) for part in parts if part]
    return pd.concat(frames, ignore_index=True) if frames else pd.DataFrame(columns=list(columns))
