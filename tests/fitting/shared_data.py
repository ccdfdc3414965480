"""Real measurements, which lie beside the checkout where they are at all."""

from __future__ import annotations

from pathlib import Path

import pytest

DATA = Path(__file__).parents[2].parent / "shared" / "data"
needs_data = pytest.mark.skipif(
    not DATA.is_dir(), reason="the measurements are not part of the project (../shared/data)"
)
