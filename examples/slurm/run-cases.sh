#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Measures every case of a folder on a cluster: sbatch examples/slurm/run-cases.sh STUDY RESULTS
# STUDY and RESULTS lie on a file system that all nodes share. The tasks take the cases one by one; submitted again with
# HELICARM_WORD set to the same word, a job that ran out of time goes on where it ended.
#SBATCH --job-name=helicarm
#SBATCH --ntasks=32
#SBATCH --cpus-per-task=1
#SBATCH --time=01:00:00
set -euo pipefail
study=$1 results=$2
srun helicarm --threads "${SLURM_CPUS_PER_TASK:-1}" run "$study"/* --out "$results" ${HELICARM_WORD:+--share "$HELICARM_WORD"}
