# SPDX-License-Identifier: MIT
# This draws small changes of the product by rule from a seed, and asks whether the tests see them. The Makefile has the
# default of N.
SEED ?= 1
ONLY ?=
LINK_SANITIZED = clang $(ASAN_FLAGS) $(LLD) $(LINK_LIMIT)
#? mutants           N=200 SEED=1: small changes drawn by rule, one at a time: do the tests see them? ONLY=core/bvh, LIST=yes
mutants: $(if $(LIST),,deps)
	@LINK='$(LINK_TEST)' LIBS='$(TEST_LIBS)' SHIPPED='$(STRICT)' LINK_SANITIZED='$(LINK_SANITIZED)' SANITIZED='$(if $(HAS_CLANG),$(ASAN))' \
		python3 -B tests/mutants/run.py -j $(JOBS) -n $(N) --seed '$(SEED)' --only '$(ONLY)' $(if $(LIST),--list) $(BUILD)
.PHONY: mutants
