# SPDX-License-Identifier: Apache-2.0
import os
import pathlib

import pytest

import revisit


@pytest.fixture
def shared():
    """Real recordings; they are not part of the project."""
    path = pathlib.Path(os.environ.get("REVISIT_SHARED_DATA", pathlib.Path(__file__).parents[4] / "shared" / "data"))
    if not path.exists():
        pytest.skip(f"needs the recordings of {path}")
    return path


@pytest.fixture(scope="session")
def drive():
    """A warehouse, 150 scans of a VLP-16: there and back."""
    return revisit.simulate(world="warehouse", sensor="vlp16", seed=5, frames=150)


@pytest.fixture(scope="session")
def scans(drive):
    return [drive[i] for i in range(len(drive))]


@pytest.fixture
def short_past():
    return revisit.Parameters(retrieval={"exclude_s": 5.05})
