# SPDX-License-Identifier: MIT
# There is a libFuzzer program for each input of the head. The programs need clang, and tests/fuzz/README.md says the
# rest.
#   make fuzz S=600           each for so many seconds, JOBS at a time; then a table
#   make fuzz N=1000000       each for so many executions; with S as well: what comes first
#   make fuzz F=config        that one alone
#   make fuzz QUICK=yes       without comparisons: a third of the time for each; what both find is shared
#   make fuzz-programs        builds them
#   make fuzz-short           what `make test` runs of them
S ?=
F ?=
FUZZ_CC ?= $(CACHED)clang
FUZZ_CXX ?= $(CACHED)clang++
QUICK ?=
FUZZ_BUILD ?= $(BUILD)/fuzz$(if $(QUICK),-quick)
FUZZ_RUNS ?= $(BUILD)/fuzz/runs
# This is coverage as libFuzzer wants it: a counter an edge (inline-8bit-counters,pc-table), and comparisons
# (trace-cmp).
# The table has processor time by compiler and flags, all with the address and undefined sanitizers. Compile times are
# for ten files of all folders, the median of three. Run times are those of test_native_damage.
#   gcc -Og                                    compiles in 2.9 s   runs in 0.97 s
#   clang -O1                                  5.9                 0.88
#   clang -O1, counters                        5.7                 0.73
#   clang -O1, counters and comparisons        6.5                 2.2
#   clang -O0                                                      3.7
#   clang -O0, counters and comparisons        2.2
#   (clang -O0 for warnings, no sanitizer:     1.1)
FUZZ_OPT ?= -O1
FUZZ_COVER ?= $(if $(QUICK),-fsanitize-coverage=inline-8bit-counters$(comma)pc-table,-fsanitize=fuzzer-no-link)
# vptr is left out, because that check needs clang++ to link, for one file.
FUZZ_SAN ?= -fsanitize=address,undefined -fno-sanitize=vptr -fno-sanitize-recover=all $(FUZZ_COVER)
FUZZ_FLAGS ?= -w -g1
# gold warns of each symbol that clang exports for the sanitizer. lld is as fast, if it is there.
FUZZ_LD = $(if $(shell command -v ld.lld),-fuse-ld=lld)
FUZZ_MAKE = $(MAKE) --no-print-directory -j$(JOBS) BUILD=$(FUZZ_BUILD) CC="$(FUZZ_CC)" CXX="$(FUZZ_CXX)" \
	OPT=$(FUZZ_OPT) WERROR= CPPFLAGS=-DSH_SANITIZE CFLAGS="$(FUZZ_FLAGS)" CXXFLAGS="$(FUZZ_FLAGS)" SAN="$(FUZZ_SAN)"
FUZZ_NAMES = $(patsubst tests/fuzz/fuzz_%.c,%,$(wildcard tests/fuzz/fuzz_*.c))
FUZZ_PROGRAMS = $(patsubst %,$(BUILD)/tests/fuzz/fuzz_%,$(or $(F),$(FUZZ_NAMES)))
FUZZ_RUN = FUZZ_BUILD=$(FUZZ_BUILD) FUZZ_RUNS=$(FUZZ_RUNS) JOBS=$(JOBS)

$(BUILD)/tests/fuzz/%: $(BUILD)/tests/fuzz/%.c.o $$(call RIGS,tests/fuzz/$$*) $(BUILD)/common.a $(BUILD)/modules.a
	@echo "  FUZZ  $@"
	$(Q)$(CC) $(SAN) -fsanitize=fuzzer $(FUZZ_LD) -o $@ $^ -lcmocka $(LDLIBS)
fuzz-objects: $(FUZZ_PROGRAMS)
fuzz-programs: deps-test
	@command -v $(lastword $(FUZZ_CC)) >/dev/null || { echo "make fuzz: $(FUZZ_CC) is not here; fuzzing needs clang" >&2; exit 2; }
	@$(FUZZ_MAKE) fuzz-objects F="$(F)"
#? fuzz              look for inputs that fail: S=600 seconds a target, F=NAME one target
fuzz: fuzz-programs
	@$(FUZZ_RUN) S='$(S)' N='$(if $(filter file,$(origin N)),,$(N))' bash tests/fuzz/fuzz_run.sh $(or $(F),$(FUZZ_NAMES))
fuzz-short: fuzz-programs
	@$(FUZZ_RUN) bash tests/fuzz/fuzz_short.sh $(or $(F),$(FUZZ_NAMES))
.PHONY: fuzz-objects fuzz-programs fuzz fuzz-short
