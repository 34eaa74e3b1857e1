"""Import the library that writes Parquet, an extra, only when it is needed."""

from __future__ import annotations

from typing import Any

from grebe.core.errors import UsageError


def arrow_for(what: str) -> tuple[Any, Any]:
    """Return pyarrow and its Parquet module; `UsageError` says that `what` needs them."""
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        raise UsageError(
            f"{what} need Parquet, which comes with: pip install 'grebe[campaign]'."
        ) from None
    return pa, pq
