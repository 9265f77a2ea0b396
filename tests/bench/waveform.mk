# SPDX-License-Identifier: MIT

.PHONY: bench-waveform
#? bench-waveform    samples of full waveforms: ns a pulse by spread and window
bench-waveform: deps-build
	@$(MAKE) --no-print-directory -j2 $(BUILD)/tests/bench/waveform
	@$(BUILD)/tests/bench/waveform
