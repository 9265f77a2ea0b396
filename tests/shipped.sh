#!/bin/sh
# SPDX-License-Identifier: MIT
# The unit tests that run as shipped, too, and not only with sanitizers: those of what computes (core), whose code the compiler
# makes into vectors, and those that do less with sanitizers.
grep -l '#include "core/\|SANITIZE\|fewer(' tests/unit/test_*.c
