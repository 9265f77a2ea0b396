# SPDX-License-Identifier: MIT
# This measures all ratios of speed in turns, and once more with AVX2 alone. SPEED has options, as in
# SPEED="--turns 1 --rounds 5 --only decode,live".
.PHONY: bench-speed bench-live
SPEED ?=
SPEED_PROGRAMS = scanhead $(patsubst %,tests/bench/%,panorama decode live loop_cost)
# This is a build for x86 without AVX-512: loops are not chosen at start, and Embree has packets of 8.
AVX2 = $(if $(filter x86_64-%,$(TARGET)),$(BUILD)/avx2)
AVX2_MAKE = $(MAKE) --no-print-directory -j2 BUILD=$(AVX2) CPPFLAGS='$(CPPFLAGS) -DVEC_ONE' \
	CFLAGS='$(CFLAGS) -march=x86-64-v3 -w' LDFLAGS='$(LDFLAGS) -Wl,--wrap=rtcNewDevice $(AVX2)/tests/bench/isa.c.o'
make_avx2 = $(if $(AVX2),$(AVX2_MAKE) $(AVX2)/tests/bench/isa.c.o && $(AVX2_MAKE) $(1:%=$(AVX2)/%))
#? bench-speed       from the schedule to the file and to a live client, beside bare Embree, in turns; also with AVX2 alone
bench-speed: deps-build
	$(call install_missing,libcmocka-dev)
	@$(MAKE) --no-print-directory -j2 $(SPEED_PROGRAMS:%=$(BUILD)/%)
	+@$(call make_avx2,$(SPEED_PROGRAMS))
	@bash tests/bench/speed.sh $(SPEED) $(BUILD) $(AVX2)
# This measures the client's side alone: its decoder, and how fast it reads sockets and USB.
bench-live: deps-build
	$(call install_missing,libcmocka-dev)
	@$(MAKE) --no-print-directory -j2 $(BUILD)/tests/bench/decode $(BUILD)/tests/bench/live
	@$(BUILD)/tests/bench/decode
	@$(BUILD)/tests/bench/live
