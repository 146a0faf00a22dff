import os
from pathlib import Path

import pytest


@pytest.fixture
def pendulum_recordings() -> Path:
    """Folder of the real pendulum recordings, beside the repository or named by ORIGAMI_RECORDINGS."""
    shared = Path(__file__).resolve().parents[2].parent / "shared" / "recordings"
    folder = Path(os.environ.get("ORIGAMI_RECORDINGS", shared)) / "pendulum_chain"
    if not folder.is_dir():
        pytest.skip(f"the real recordings are not in {folder} (set ORIGAMI_RECORDINGS)")
    return folder
