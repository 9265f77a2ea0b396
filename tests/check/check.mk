# SPDX-License-Identifier: MIT
# This runs analysers over the code, and ThreadSanitizer over the program (README.md here).
#   make check                all of it
#   make check-analysers      clang-tidy's analyzer and cppcheck
#   make check-tsan           every kind of link, pace and source, with clients; CHECK_S=15 seconds a round
#   make check-tsan-short     what `make test` runs of it
DEPS_CHECK = clang clang-tidy libclang-rt-dev cppcheck python3 python3-numpy
CHECK_S ?= 15
CHECK_FILES = $(SRC) $(wildcard firmware_sim/*.c)
CHECK_FLAGS = -std=c11 -I. -I$(BUILD) -D_GNU_SOURCE -DSH_EMBREE=$(EMBREE_VERSION) $(if $(USBREDIR),-DHAVE_USBREDIR) $(SONAMES) $(PKG_CFLAGS)
deps-check: deps-build
	$(call install_missing,$(DEPS_CHECK))
check-analysers: deps-check $(BUILD)/drivers/link/web_pages.inc
	@python3 tests/check/analyse.py --out $(BUILD)/check --jobs $(JOBS) $(CHECK_FILES) -- $(CHECK_FLAGS)
# CPPFLAGS selects the code that is built otherwise for sanitizers. -O1 is enough because races are those of the source,
# and it takes a third of the time.
TSAN = $(ASAN_CC) OPT=-O1 WERROR= CFLAGS="-g1 -w" CXXFLAGS="-g1 -w" CPPFLAGS=-DSH_SANITIZE SAN=-fsanitize=thread
check-tsan: deps-check
	@$(MAKE) --no-print-directory -j$(JOBS) BUILD=$(BUILD)/tsan $(TSAN) $(BUILD)/tsan/scanhead
	@python3 tests/check/tsan.py --scanhead $(BUILD)/tsan/scanhead --out $(BUILD)/tsan/rounds --seconds $(CHECK_S)
#? check             analysers and ThreadSanitizer: some minutes
check: check-analysers check-tsan
.PHONY: deps-check check check-analysers check-tsan check-tsan-short

# This is the short form. Only the code that threads share is built for it, and linked with the rest as it is (PLAIN is
# the build that the rest comes from). -O0 is built fastest, and finds the same.
PLAIN ?= $(BUILD)/test
TSAN_SHARED = $(wildcard firmware_sim/loop/*.c firmware_sim/device/*.c firmware_sim/fault/*.c drivers/link/*.c)
TSAN_SHORT = $(TSAN) OPT=-O0 BUILD=$(BUILD)/tsan_short PLAIN=$(PLAIN) $(BUILD)/tsan_short/tsan_head
$(BUILD)/tsan_head: $(TSAN_SHARED:%=$(BUILD)/%.o) $(PLAIN)/firmware_sim/main.c.o $(PLAIN)/modules.a
	@echo "  LD    $@"
	$(Q)$(CC) $(SAN) $(FAST_LD) -o $@ $^ $(LDLIBS)
check-tsan-short: deps-check
	@$(MAKE) --no-print-directory -j$(JOBS) $(STRICT) BUILD=$(PLAIN) $(PLAIN)/scanhead
	@$(MAKE) --no-print-directory -j$(JOBS) $(TSAN_SHORT)
	@TSAN_HEAD=$(BUILD)/tsan_short/tsan_head bash tests/check/tsan_short.sh
