# SPDX-License-Identifier: Apache-2.0
"""Files of other people's libraries; those that are not installed are left out with a line."""
import pytest

import peers


@pytest.mark.parametrize("judge, package, limits", [(judge, package, limits) for judge, package, _, _, limits, _ in peers.JUDGES],
                         ids=[judge.__name__ for judge, *_ in peers.JUDGES])
def test_a_peer_agrees(judge, package, limits, tmp_path):
    if not peers.is_there(package):
        pytest.skip(f"{package} is not installed")
    count, *off = judge(tmp_path)
    assert count > 0 and all(value <= limit for value, limit in zip(off, limits)), (count, off)
