# SPDX-License-Identifier: MIT
# Small faults, put in one at a time: do the tests see them? M='record-*' takes some. ALL=yes runs all tests against those
# that their own tests miss. tests/mutants/README.md says more.
# M is shared with `make machines`, so it has no default of its own.
ALL ?= no
#? mutants           small faults, one at a time: do the tests see them? Half an hour
mutants: deps
	@bash tests/mutants/run.sh -j $(JOBS) $(if $(filter yes,$(ALL)),-a) $(BUILD) '$(or $(M),*)'
.PHONY: mutants
