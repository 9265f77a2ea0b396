# SPDX-License-Identifier: MIT
# This measures how late the pacing thread wakes up, beside cyclictest in turns. It takes under two minutes.
.PHONY: bench-rt
#? bench-rt          how late the pacing thread wakes up, beside cyclictest
bench-rt: deps-build
	$(call install_missing,rt-tests)
	@$(MAKE) --no-print-directory -j2 all
	@sh tests/bench/real_time.sh $(BUILD)/scanhead $(BUILD)/bench-rt
