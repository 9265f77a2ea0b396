#!/bin/bash
# SPDX-License-Identifier: MIT
# The page's panels in node, without a browser: tests/unit/page_panels.mjs says what is compared.
set -eu
cd "$(dirname "$0")/.."
command -v node >/dev/null || { echo "1..0 # SKIP node is missing"; exit 0; }
node tests/unit/page_panels.mjs
