#!/bin/sh
# SPDX-License-Identifier: MIT
# This runs a campaign by GNU parallel: some shards at a time, on this machine or on several. Then it checks all files.
#
#   sh parallel.sh CONFIG -o DIR [options of scanhead batch]
#
# SCANHEAD: the program (default: scanhead of PATH). SHARDS: the number of shards (default: one per processor of this
# machine). JOBS: shards at a time on a machine (default: one per processor). THREADS: threads of a shard (default: 1).
# MACHINES: a file with a line for each machine, as --sshloginfile has it.
set -eu

program=${SCANHEAD:-scanhead}
shards=${SHARDS:-$(getconf _NPROCESSORS_ONLN)}
seq "$shards" | parallel --will-cite --quote --jobs "${JOBS:-100%}" -I @SHARD@ --line-buffer \
    ${MACHINES:+--sshloginfile "$MACHINES" --workdir .} \
    "$program" batch "$@" --threads "${THREADS:-1}" --shard "@SHARD@/$shards" || exit 1
exec "$program" batch "$@" --merge
