#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Every study writes the same bytes on any number of MPI ranks. Usage: ranks_test.py SMALL_STUDIES MPIRUN"""

import os
import re
import subprocess
import sys
import tempfile

program, mpirun = sys.argv[1:]
environment = {**os.environ, "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
                "OMPI_MCA_rmaps_base_oversubscribe": "1", "OMPI_MCA_mpi_yield_when_idle": "1",
                "OMPI_MCA_plm_rsh_agent": "false"}  # all on this machine: no remote shell is needed


def studies(ranks, *command):
    """Name and bytes of each study."""
    with tempfile.TemporaryDirectory() as folder:
        text = subprocess.run([*command, program, folder], check=True, stdout=subprocess.PIPE, text=True,
                              env=environment, timeout=300).stdout
    parts = re.split(f"^=== (.*), {ranks} ranks\n", text, flags=re.M)[1:]
    return dict(zip(parts[::2], parts[1::2]))


alone = studies(1)
assert len(alone) == 10 and all(alone.values()), alone.keys()
for ranks in (2, 3):
    shared = studies(ranks, mpirun, "-n", str(ranks))
    assert shared.keys() == alone.keys(), shared.keys()
    different = [name for name in alone if shared[name] != alone[name]]
    assert not different, f"on {ranks} ranks: {different}"
