#!/bin/sh
# SPDX-License-Identifier: MIT
# This tests the page in a real browser: its content beside the record, and its effect on the head. It prints TAP, and
# is skipped if the browser or node is missing. $SCANHEAD names the program. CHROMIUM=... names another browser.
set -u
cd "$(dirname "$0")/../.." || exit 1
skip() {
    echo "1..0 # SKIP $1"
    exit 0
}
command -v setpriv >/dev/null || skip "setpriv is missing (Debian: util-linux)"
command -v node >/dev/null || skip "node is missing (Debian: nodejs)"
[ "$(node -p 'process.versions.node.split(".")[0]')" -ge 18 ] || skip "node $(node --version) is too old: 18 or later"
[ -n "${CHROMIUM:-}" ] || command -v chromium chromium-browser google-chrome >/dev/null || skip "chromium is missing (Debian: chromium)"
exec node tests/page/test_page.mjs
