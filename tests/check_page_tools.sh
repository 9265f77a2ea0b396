#!/bin/bash
# SPDX-License-Identifier: MIT
# This tests the pure parts of the page's tools in node; tests/unit/page_tools.mjs says which.
set -eu
cd "$(dirname "$0")/.."
command -v node >/dev/null || { echo "1..0 # SKIP node is missing"; exit 0; }
exec node tests/unit/page_tools.mjs
