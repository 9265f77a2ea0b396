#!/bin/bash
# SPDX-License-Identifier: MIT
# This tests waveforms in the page, in node; tests/unit/page_waves.mjs says what is tested.
set -eu
cd "$(dirname "$0")/.."
command -v node >/dev/null || { echo "1..0 # SKIP node is missing"; exit 0; }
exec node tests/unit/page_waves.mjs
