# Debian 13, x86 without AVX2 and without AVX, and 64-bit ARM, each in a root of its own or emulated: README.md here.
M ?= trixie avx sse aarch64
machines:
	@MAKE='$(MAKE) --no-print-directory' JOBS=$(JOBS) sh tests/machines/run.sh $(BUILD) $(M)
.PHONY: machines
