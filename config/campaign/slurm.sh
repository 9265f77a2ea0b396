#!/bin/sh
# SPDX-License-Identifier: MIT
# A campaign as a Slurm array: each task is one shard.
#
#   sbatch --array=1-16 slurm.sh CONFIG -o DIR [options of scanhead batch]
#
# SCANHEAD: the program (default: scanhead of PATH). SHARDS: the number of all shards, if the array has only some.
# With SHARDS, task I does shard I. So single shards can be done again: SHARDS=16 sbatch --array=3,7 ...
#SBATCH --job-name=scanhead
#SBATCH --array=1-16
#SBATCH --cpus-per-task=4
#SBATCH --mem=8G
#SBATCH --time=08:00:00
#SBATCH --signal=B:TERM@120
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=scanhead-%A_%a.log
set -eu

: "${SLURM_ARRAY_TASK_ID:?this is a task of an array: sbatch --array=1-16 slurm.sh CONFIG -o DIR}"
if [ -n "${SHARDS:-}" ]; then
    shard=$SLURM_ARRAY_TASK_ID/$SHARDS
else
    shard=$(((SLURM_ARRAY_TASK_ID - ${SLURM_ARRAY_TASK_MIN:-1}) / ${SLURM_ARRAY_TASK_STEP:-1} + 1))/$SLURM_ARRAY_TASK_COUNT
fi
# In place of this shell: Slurm's signal goes to the program, which then ends in good order.
exec "${SCANHEAD:-scanhead}" batch "$@" --shard "$shard" --threads "${SLURM_CPUS_PER_TASK:-0}"
