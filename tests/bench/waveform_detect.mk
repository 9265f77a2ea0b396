# SPDX-License-Identifier: MIT

.PHONY: bench-detect
#? bench-detect      echoes found in waveforms: ns a pulse beside the error, by detector
bench-detect: deps-build
	@$(MAKE) --no-print-directory -j2 $(BUILD)/tests/bench/waveform_detect
	@$(BUILD)/tests/bench/waveform_detect
