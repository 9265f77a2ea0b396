# SPDX-License-Identifier: MIT
# This measures scanheadd beside scanhead, in turns. It takes seconds.
.PHONY: bench-board
#? bench-board       size of scanheadd, its memory at idle, and what its start takes
bench-board: deps-build
	@$(MAKE) --no-print-directory -j2 all
	@bash tests/bench/board.sh $(BUILD)/bench-board $(BUILD)/scanheadd $(BUILD)/scanhead
