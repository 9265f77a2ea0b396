#!/bin/sh
# SPDX-License-Identifier: MIT
# Lists the unit tests that run as shipped, too, and not only with sanitizers: those of core, whose code the compiler
# vectorises, and those that do less with sanitizers.
grep -l '#include "core/\|SANITIZE\|fewer(' tests/unit/test_*.c
