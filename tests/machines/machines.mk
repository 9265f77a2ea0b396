# SPDX-License-Identifier: MIT
# This tests Debian 13, x86 without AVX2 and without AVX, and 64-bit ARM, each in a root of its own or emulated
# (README.md here).
# make has another name here, so that `make -n` prints the line and does not run it.
MACHINES_MAKE = $(MAKE) --no-print-directory
#? machines          the tests on Debian 13, ARM, x86 without AVX2 and without AVX: hours
machines:
	@MAKE='$(MACHINES_MAKE)' JOBS=$(JOBS) sh tests/machines/run.sh $(BUILD) $(foreach m,$(or $(M),trixie avx sse aarch64),'$(m)')
.PHONY: machines
