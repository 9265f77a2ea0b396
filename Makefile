# SPDX-License-Identifier: MIT
# scanhead. `make` builds build/scanhead, build/scanheadd and build/libscanhead.{a,so}.
# `make demo` and `make test` install what is missing (Debian; sudo when not root), build and run.
BUILD ?= build
$(if $(filter 1,$(words $(BUILD))),,$(error BUILD="$(BUILD)": a path without blanks is allowed))
PREFIX ?= /usr/local
# For another machine: CROSS_COMPILE=aarch64-linux-gnu-, or a compiler whose name or --target says it. Tools that are
# not given have the same prefix.
ifeq ($(origin CC),default)
CROSS_COMPILE ?=
CC = $(CROSS_COMPILE)gcc
else
by_target = $(patsubst --target=%,%-,$(filter --target=%,$(CC)))
by_name = $(foreach w,$(notdir $(CC)),$(if $(findstring -gcc,$(w)),$(firstword $(subst -gcc, ,$(w)))-))
CROSS_COMPILE ?= $(strip $(by_target) $(by_name))
endif
ifeq ($(origin CXX),default)
CXX = $(CROSS_COMPILE)g++
endif
ifeq ($(origin AR),default)
AR = $(CROSS_COMPILE)ar
endif
OBJCOPY ?= $(CROSS_COMPILE)objcopy
PKG_CONFIG ?= $(CROSS_COMPILE)pkg-config
TARGET = $(eval TARGET := $$(shell $(CC) -dumpmachine))$(TARGET)
V ?= 0
Q_0 = @
Q = $(Q_$(V))

# A fresh Debian 12 needs these packages for building and for the demo.
DEPS_BUILD = gcc g++ make pkg-config libc6-dev libembree-dev libassimp-dev libgeographiclib-dev libproj-dev libyaml-dev libpng-dev \
	libstb-dev nettle-dev libusb-1.0-0-dev libusbredirparser-dev libwebsockets-dev libjansson-dev libwebp-dev libtiff-dev \
	libmeshoptimizer-dev assimp-testmodels \
	$(if $(shell command -v npm),,nodejs npm)
# The tests need these packages, too: the second compiler and its sanitizers, and clients and readers of other projects.
DEPS_TEST = $(DEPS_BUILD) libcmocka-dev clang clang-format libclang-rt-dev lld ccache gpsd gpsd-clients cloudcompare mrpt-apps proj-bin python3-numpy \
	llvm parallel tshark tcpreplay
# The guest tests; they are skipped where these can't be had. The kernel (linux-image-amd64) is fetched, not installed.
DEPS_GUEST = qemu-system-x86 busybox-static cpio kmod xz-utils usbutils usbip
# The browser that the page is tested in; these tests are skipped where it can't be had.
DEPS_BROWSER = chromium

# Without libusbredirparser everything builds but the back end that needs it.
USBREDIR = $(eval USBREDIR := $$(shell $(PKG_CONFIG) --exists libusbredirparser-0.5 && echo libusbredirparser-0.5))$(USBREDIR)
PKGS = yaml-0.1 libpng proj nettle libusb-1.0 libwebsockets jansson libwebp libtiff-4 $(USBREDIR)
ask_pkg_config = $(shell $(PKG_CONFIG) $(1) $(PKGS))$(if $(filter-out 0,$(.SHELLSTATUS)),$(error $(PKG_CONFIG) does not \
	find all of $(PKGS): make deps-build, or PKG_CONFIG=... for another machine))
PKG_CFLAGS = $(eval PKG_CFLAGS := $$(call ask_pkg_config,--cflags))$(PKG_CFLAGS)
PKG_LIBS = $(eval PKG_LIBS := $$(filter-out $$(LATE:%=-l%),$$(call ask_pkg_config,--libs)))$(PKG_LIBS)
# A program loads these libraries when it needs them (core/late.h), by their SONAME, as if it were linked with them.
LATE = proj assimp tiff websockets
find_soname = $(or $(shell readelf -d $$($(CC) -print-file-name=lib$(1).so) | sed -n 's/.*SONAME.*\[\(.*\)\]/\1/p'),$(error no \
	lib$(1).so for $(CC): make deps-build))
SONAMES = $(eval SONAMES := $$(foreach l,$$(LATE),-DSONAME_$$(l)='"$$(call find_soname,$$(l))"'))$(SONAMES)
# These lines alone choose the version of Embree's headers and library. EMBREE=4 asks for version 4. Without EMBREE,
# version 3 is taken where both are installed.
has_embree = $(shell $(CC) $(CPPFLAGS) -E -xc -include embree$(1)/rtcore.h /dev/null >/dev/null 2>&1 && echo $(1))
find_embree = $(or $(firstword $(foreach v,$(filter 3 4,$(or $(EMBREE),3 4)),$(call has_embree,$(v)))),$(error no \
	Embree $(or $(EMBREE),3 or 4) for $(CC); allowed 3 and 4: make deps-build, or EMBREE= for the one that is there))
EMBREE_VERSION = $(eval EMBREE_VERSION := $$(call find_embree))$(EMBREE_VERSION)
OPT ?= -O3 $(VEC_WIDTH)
# Loops use all 512 bits of vectors on CPUs that have them. On other machines than x86 gcc and clang refuse the option.
VEC_WIDTH = $(if $(filter x86_64-%,$(TARGET)),-mprefer-vector-width=512)
# Arithmetic in floating point uses constants of enums; clang 19 would warn of that.
WARN = -Wall -Wextra -Wconversion -Wshadow -Wno-enum-float-conversion
CWARN = $(WARN) -Wstrict-prototypes -Wmissing-prototypes
# `make test` turns warnings into errors; a user's newer compiler may warn in peace.
WERROR ?=
SAN ?=
# Without contraction to FMA numbers are the same on every instruction set. errno and traps of libm are not used.
FP = -ffp-contract=off -fno-math-errno -fno-trapping-math
HEADS_DIR = $(PREFIX)/share/scanhead/heads
SCENES_DIR = $(PREFIX)/share/scanhead/scenes
FAULTS_DIR = $(PREFIX)/share/scanhead/faults
CAMPAIGN_DIR = $(PREFIX)/share/scanhead/campaign
# LIB is the folder of libraries below PREFIX; a distribution may have one for each machine.
LIB = lib
IFC_DIR = $(PREFIX)/share/scanhead/ifc
UDEV_DIR = $(PREFIX)/lib/udev/rules.d
UNIT_DIR = $(PREFIX)/lib/systemd/system
PC_DIR = $(PREFIX)/$(LIB)/pkgconfig
MAN_DIR = $(PREFIX)/share/man
COMPLETION_DIR = $(PREFIX)/share/bash-completion/completions
# PRINTER prints manual pages and the completion, and PRINTER with a d those of scanheadd. In a build for another
# machine both are programs that run here.
PRINTER = $(BUILD)/scanhead
WIRESHARK_DIR = $(PREFIX)/share/scanhead/wireshark
ALL_CPPFLAGS = -I. -D_GNU_SOURCE -DSH_EMBREE=$(EMBREE_VERSION) $(if $(USBREDIR),-DHAVE_USBREDIR) -MMD -MP $(CPPFLAGS)
ALL_CFLAGS = -std=c11 $(OPT) -g $(FP) $(CWARN) $(WERROR) -fPIC -pthread $(SAN) $(PKG_CFLAGS) $(CFLAGS)
ALL_CXXFLAGS = -std=c++17 $(OPT) -g $(FP) $(WARN) $(WERROR) -fPIC -pthread $(SAN) $(CXXFLAGS)
LDLIBS = -lembree$(EMBREE_VERSION) -lmeshoptimizer -lGeographicLib $(PKG_LIBS) -lstdc++ -lm -pthread

CORE = $(wildcard core/*.c core/*/*.c core/*/*/*.c) core/georef/geographiclib_shim.cpp
PROTO = $(wildcard drivers/protocol/*.c)
HOST = $(wildcard drivers/host/*.c)
SRC = $(CORE) $(wildcard drivers/*/*.c firmware_sim/*/*.c firmware_sim/*/*/*.c firmware_sim/*/*/*/*.c)
OBJ = $(SRC:%=$(BUILD)/%.o)
# The head is all but the studio; tests/check_includes.sh has the same list.
STUDIO = core/studio/% drivers/record/% firmware_sim/app/studio/%
HEAD_OBJ = $(filter-out $(STUDIO:%=$(BUILD)/%),$(OBJ))
LIBOBJ = $(patsubst %,$(BUILD)/%.o,core/err.c $(PROTO) $(HOST))
PROGRAMS = $(patsubst tests/%.c,$(BUILD)/tests/%,$(wildcard tests/$(1)/test_*.c))
UNIT = $(call PROGRAMS,unit)
# In `make test` (and tests/run_all.sh) all unit tests run with sanitizers. Unit tests of core, and unit tests that do
# less with sanitizers, run as shipped, too: without sanitizers. In `make test-unit` no unit test has sanitizers.
SHIPPED = $(patsubst tests/%.c,$(BUILD)/tests/%,$(shell sh tests/shipped.sh))
TESTS = $(UNIT) $(call PROGRAMS,wire) $(call PROGRAMS,accuracy) $(call PROGRAMS,stability) $(call PROGRAMS,guest)
# JOIN says which test programs are linked at once: all but those of the guest; the unit tests; or (shipped) all but
# those of the guest and the unit tests that run with sanitizers alone.
JOIN ?= all
JOINED_unit = $(UNIT)
JOINED_all = $(filter-out $(call PROGRAMS,guest),$(TESTS))
JOINED_shipped = $(filter-out $(filter-out $(SHIPPED),$(UNIT)),$(JOINED_all))
JOINED = $(JOINED_$(JOIN))
# Both programs have the one main.c.
MAINS = $(BUILD)/firmware_sim/main.c.o $(BUILD)/firmware_sim/scanheadd.o
EVERYTHING = $(OBJ) $(MAINS)

IFC_READERS = $(BUILD)/ifc
IFC_PROGRAMS = $(patsubst core/import/ifc/%,$(IFC_READERS)/%,$(wildcard core/import/ifc/*.mjs))
#? all               build/scanhead, build/scanheadd, and the client library as build/libscanhead.{a,so}
all: $(BUILD)/scanhead $(BUILD)/scanheadd $(BUILD)/libscanhead.a $(BUILD)/libscanhead.so $(IFC_PROGRAMS)

$(BUILD)/%.c.o: %.c $(BUILD)/flags
	@mkdir -p $(@D)
	@echo "  CC    $<"
	$(Q)$(CC) $(ALL_CPPFLAGS) $(ALL_CFLAGS) -c $< -o $@
$(BUILD)/%.cpp.o: %.cpp $(BUILD)/flags
	@mkdir -p $(@D)
	@echo "  CXX   $<"
	$(Q)$(CXX) $(ALL_CPPFLAGS) $(ALL_CXXFLAGS) -c $< -o $@
# Stamps hold what a build is made of. Everything is built again once the tools or flags have changed, and an archive
# once a source has come or gone. ccache and -Werror change nothing of an object.
STAMPS = $(patsubst %,$(BUILD)/%,flags modules.members head.members library.members common.members benches.members joined.members sonames)
$(BUILD)/flags: NOW = $(filter-out ccache %/ccache -Werror,$(CC) $(CXX) $(AR) $(OBJCOPY) $(ALL_CPPFLAGS) $(ALL_CFLAGS) $(ALL_CXXFLAGS) \
	$(CORE_OPT) $(TEST_WARN) $(LDFLAGS) $(LDLIBS))
$(BUILD)/modules.members: NOW = $(SRC)
$(BUILD)/head.members: NOW = $(HEAD_OBJ)
$(BUILD)/library.members: NOW = $(LIBOBJ)
$(BUILD)/common.members: NOW = $(COMMON)
$(BUILD)/benches.members: NOW = $(BENCHES)
$(BUILD)/joined.members: NOW = $(JOINED)
$(BUILD)/sonames: NOW = $(SONAMES)
quoted = '$(subst ','\'',$(strip $(1)))'
$(STAMPS): ALWAYS
	@mkdir -p $(@D)
	@printf '%s\n' $(call quoted,$(NOW)) | cmp -s - $@ || printf '%s\n' $(call quoted,$(NOW)) >$@
# The files of the web page are built into the program. This writes a line for each, which web_pages.c includes.
WEB_FILES = $(sort $(filter-out %.md,$(wildcard drivers/link/web/*)))
$(BUILD)/drivers/link/web_pages.inc: ALWAYS
	@mkdir -p $(@D)
	@new=$@.$$$$; n=0; for f in $(WEB_FILES); do n=$$((n + 1)); echo "WEB_PAGE($$n, \"$$f\", \"/$${f##*/}\")"; done >$$new; \
	cmp -s $$new $@ || cp $$new $@; rm $$new
$(BUILD)/drivers/link/web_pages.c.o: private override ALL_CPPFLAGS += -I$(BUILD)
$(BUILD)/core/late.c.o: private override ALL_CPPFLAGS += $(SONAMES)
$(BUILD)/core/late.c.o: $(BUILD)/sonames
$(BUILD)/drivers/link/web_pages.c.o: $(BUILD)/drivers/link/web_pages.inc $(WEB_FILES)
ALWAYS:
# modules.a has all modules, for scanhead and the tests. head.a has the modules of scanheadd.
$(BUILD)/modules.a: $(OBJ) $(BUILD)/modules.members
$(BUILD)/head.a: $(HEAD_OBJ) $(BUILD)/head.members
ARCHIVES = $(patsubst %,$(BUILD)/%.a,modules head libscanhead client common benches)
$(ARCHIVES):
	@rm -f $@
	@echo "  AR    $@"
	$(Q)$(AR) rcs $@ $(filter %.o,$^)
# The library's archive has one object, in which all names but those of the interface are local. So they can't clash
# with names of a client.
$(BUILD)/libscanhead.o: $(LIBOBJ) $(BUILD)/library.members
	@echo "  LD    $@"
	$(Q)$(CC) -r -nostdlib -o $@ $(LIBOBJ)
	$(Q)$(OBJCOPY) --wildcard --keep-global-symbol='scanhead_*' $@
$(BUILD)/libscanhead.a: $(BUILD)/libscanhead.o
$(BUILD)/client.a: $(LIBOBJ) $(BUILD)/library.members
$(BUILD)/libscanhead.so: $(LIBOBJ) $(BUILD)/library.members drivers/host/libscanhead.map
	@echo "  LD    $@"
	$(Q)$(CC) -shared $(SAN) $(LDFLAGS) -Wl,--version-script=drivers/host/libscanhead.map -Wl,-soname,libscanhead.so.1 \
		-o $@ $(LIBOBJ) -lnettle -lusb-1.0 -lm
$(BUILD)/scanhead: $(BUILD)/firmware_sim/main.c.o $(BUILD)/modules.a
	@echo "  LD    $@"
	$(Q)$(CC) $(SAN) $(LDFLAGS) -o $@ $^ $(LDLIBS)
#? scanheadd         the head alone, for a board: run, plan, check, list
scanheadd: $(BUILD)/scanheadd
# It is linked with the libraries that it needs and no others.
$(BUILD)/firmware_sim/scanheadd.o: firmware_sim/main.c $(BUILD)/flags
	@mkdir -p $(@D)
	@echo "  CC    $< alone"
	$(Q)$(CC) $(ALL_CPPFLAGS) -DHEAD_ALONE $(ALL_CFLAGS) -c $< -o $@
$(BUILD)/scanheadd: $(BUILD)/firmware_sim/scanheadd.o $(BUILD)/head.a
	@echo "  LD    $@"
	$(Q)$(CC) $(SAN) $(LDFLAGS) -o $@ $^ -Wl,--as-needed $(LDLIBS)

# ---- test programs. A program of tests/ is linked with
#   common.a    tests/common: scenes, references, clients                   all of them
#   benches.a   what the programs of tests/bench share                      build/bench and the charts'
#   its rigs    tests/unit/cast_rig.c where it includes cast_rig.h          tests of a folder; tests/rigs.sh finds which
#   modules.a   head and studio, no main                                    all of them
FIGURES = $(patsubst %,$(BUILD)/tests/bench/%,chart chart_moving chart_sight chart_georef chart_widths beam plain velodyne waves waveform waveform_detect loop_cost loading kernels panorama copies decode live write_mesh)
BENCH_MAINS = $(FIGURES:$(BUILD)/%=%.c) tests/bench/bench.c
# LIMIT ends a test program that waits for ever. It is linked as an object: nothing calls it, so the linker would leave
# it in an archive.
LIMIT = tests/common/limit.c
LINK_LIMIT = -Wl,--wrap=_cmocka_run_group_tests
COMMON = $(filter-out $(LIMIT),$(wildcard tests/common/*.c))
BENCHES = $(filter-out $(BENCH_MAINS),$(wildcard tests/bench/*.c))
PAIRS = $(eval PAIRS := $$(shell sh tests/rigs.sh))$(PAIRS)
RIGS = $(patsubst $(1):%,$(BUILD)/%.o,$(filter $(1):%,$(PAIRS)))
$(BUILD)/common.a: $(COMMON:%=$(BUILD)/%.o) $(BUILD)/common.members
$(BUILD)/benches.a: $(BENCHES:%=$(BUILD)/%.o) $(BUILD)/benches.members
$(BUILD)/bench: $(BUILD)/tests/bench/bench.c.o
$(FIGURES): $(BUILD)/%: $(BUILD)/%.c.o
$(BUILD)/bench $(FIGURES): $(BUILD)/benches.a $(BUILD)/common.a $(BUILD)/modules.a
	@echo "  LD    $@"
	$(Q)$(CC) $(SAN) $(LDFLAGS) -o $@ $(filter %.o,$^) $(filter %.a,$^) $(LDLIBS)
# live reads a head on a bus that is made up: the unit tests' stand-in for libusb, which needs cmocka.
$(BUILD)/tests/bench/live: $(BUILD)/tests/unit/fake_libusb.c.o
$(BUILD)/tests/bench/live: private override LDFLAGS += -Wl,--as-needed
$(BUILD)/tests/bench/live: private override LDLIBS += -lcmocka
# stb_image_write shifts into the sign bit.
$(BUILD)/tests/common/chart.c.o: private override SAN =
# With sanitizers core has flags of its own: it is a sixth of the code, and takes most of the time.
$(BUILD)/core/%.o: private override OPT += $(CORE_OPT)
# With sanitizers some tests leave out parts of their code (SH_SANITIZE). So they are compiled without warnings there.
$(BUILD)/tests/%.o: private override CWARN += $(TEST_WARN)
# These compute little themselves, and are built in half the time.
$(BUILD)/tests/unit/% $(BUILD)/tests/wire/% $(BUILD)/tests/guest/%: private OPT += -O1
# Some 500 programs are linked, twenty at a time; gold takes two thirds of the time that ld takes.
# lld links what clang compiled: gold warns of the symbols of clang's sanitizers.
# A program loads the libraries that it needs and no others: those of Embree and Assimp take longer than many a test.
FAST_LD = $(if $(CROSS_COMPILE),,$(if $(findstring clang,$(CC)),$(LLD),$(GOLD)))
GOLD := $(if $(shell command -v ld.gold),-fuse-ld=gold)
LLD := $(if $(shell command -v ld.lld),-fuse-ld=lld)
LINK_TEST = $(CC) $(SAN) $(FAST_LD) $(LINK_LIMIT)
TEST_LIBS = -Wl,--as-needed -lcmocka -lassimp -ltiff $(LDLIBS)
.SECONDEXPANSION:
# This rule links all test programs of JOINED, twenty in a file.
$(BUILD)/tests/joined: $$(sort $$(foreach p,$$(JOINED),$$(p).c.o $$(call RIGS,$$(patsubst $$(BUILD)/%,%,$$(p))))) $(BUILD)/$(LIMIT).o \
	$(BUILD)/common.a $(BUILD)/modules.a $(BUILD)/joined.members tests/join.sh
	@echo "  JOIN  $(words $(JOINED)) test programs"
	$(Q)LINK='$(LINK_TEST)' LIBS='$(TEST_LIBS)' LD='$(CROSS_COMPILE)ld' OBJCOPY='$(OBJCOPY)' JOBS=$(JOBS) bash tests/join.sh $(BUILD) $(JOINED)
	@touch $@
$(BUILD)/tests/%: $(BUILD)/tests/%.c.o $$(call RIGS,tests/$$*) $(BUILD)/$(LIMIT).o $(BUILD)/common.a $(BUILD)/modules.a
	@echo "  TEST  $@"
	@rm -f $@
	$(Q)$(LINK_TEST) -o $@ $^ $(TEST_LIBS)
# Test programs of the guest are linked with client.a alone: the client library with its internal names. So they start
# faster in the guest.
$(BUILD)/tests/guest/%: $(BUILD)/tests/guest/%.c.o $$(call RIGS,tests/guest/$$*) $(BUILD)/$(LIMIT).o $(BUILD)/client.a
	@echo "  TEST  $@"
	$(Q)$(CC) $(SAN) $(LINK_LIMIT) -o $@ $^ -lcmocka -lnettle -lusb-1.0 -lm -pthread

# ---- packages: only missing ones are installed; DEPS=no installs nothing
DEPS ?= yes
define install_missing
	@[ '$(DEPS)' != no ] || exit 0; missing=; for p in $(1); do dpkg-query -W -f='$${Status}' $$p 2>/dev/null | grep -q 'ok installed' || missing="$$missing $$p"; done; \
	if [ -n "$$missing" ]; then \
		echo "installing:$$missing"; \
		if [ "$$(id -u)" = 0 ]; then sudo=; elif command -v sudo >/dev/null; then sudo=sudo; \
		else echo "these packages are missing and neither root nor sudo is at hand:$$missing" >&2; exit 1; fi; \
		$$sudo apt-get update -qq && $$sudo env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $$missing >/dev/null; \
	fi
endef
# The readers for LAS and E57 are npm's, in the versions of the lock file. Without its registry their tests are skipped.
READERS = $(BUILD)/readers
#? deps              install what building, the demo and the tests need (Debian)
deps: deps-test $(READERS)/installed
$(READERS)/installed: $(wildcard tests/readers/*) | $(if $(DEPS_ARE_THERE),,deps-test)
	@mkdir -p $(@D)
	@cp tests/readers/* $(@D)
	@if [ '$(DEPS)' = no ]; then echo "DEPS=no: the readers for LAS and E57 are not installed: their tests will be skipped"; \
	elif (cd $(@D) && npm ci --no-audit --no-fund --loglevel=error --fetch-retries=0 --fetch-timeout=30000) >$(@D)/npm.log 2>&1; then touch $@; \
	else echo "npm could not install the readers for LAS and E57 ($(@D)/npm.log): their tests will be skipped"; fi
# The readers of IFC bodies are npm's, in the versions of the lock file. Without npm or node Assimp reads IFC.
ifc-readers: $(IFC_READERS)/installed $(IFC_PROGRAMS)
$(IFC_READERS)/installed: $(wildcard $(addprefix core/import/ifc/,package.json package-lock.json .npmrc))
	@mkdir -p $(@D)
	@$(if $^,cp $^ $(@D),:)
	@if [ '$(DEPS)' = no ]; then echo "DEPS=no: the readers of IFC are not installed: Assimp reads it"; \
	elif (cd $(@D) && npm ci --ignore-scripts --no-audit --no-fund --loglevel=error --fetch-retries=1 --fetch-timeout=60000) \
		>$(@D)/npm.log 2>&1; then touch $@; \
	else echo "npm could not install the readers of IFC ($(@D)/npm.log): Assimp reads it"; fi
$(IFC_READERS)/%.mjs: core/import/ifc/%.mjs
	@mkdir -p $(@D)
	@cp $< $@
# PCL's headers take long to compile. Where PCL is not installed, the test is skipped.
$(READERS)/pcl_vlp16: tests/readers/pcl_vlp16.in
	@mkdir -p $(@D)
	@! pkg-config --exists pcl_io 2>/dev/null || g++ -O0 -w -x c++ $< -o $@ $$(pkg-config --cflags --libs pcl_io)
deps-test:
	$(call install_missing,$(DEPS_TEST))
	@$(MAKE) --no-print-directory ifc-readers
	@$(MAKE) --no-print-directory deps-guest || echo "the guest tests will be skipped"
	@$(MAKE) --no-print-directory deps-browser || echo "the tests of the page will be skipped"
deps-guest:
	$(call install_missing,$(DEPS_GUEST))
deps-browser:
	$(call install_missing,$(DEPS_BROWSER))
deps-build:
	$(call install_missing,$(DEPS_BUILD))
	@$(MAKE) --no-print-directory ifc-readers

#? demo              a head on a virtual serial port scans the house; a client records it
demo: deps-build
	@$(MAKE) --no-print-directory -j2 all
	@sh config/demo.sh $(BUILD)/scanhead $(BUILD)/demo

# ---- tests. Warnings are errors. There are two builds. One has everything with gcc, as it is shipped. The other has the
# unit tests with sanitizers and the fuzz targets, with clang and its warnings; without clang gcc builds them. Marks of
# coverage for the fuzz targets cost a tenth. clang takes a third of the time at -O0 that it takes at -O1 (gcc with
# sanitizers: two thirds); core alone is worth -O1. With -g1, which keeps line numbers alone, compiling takes an eighth
# less time.
JOBS ?= $(shell getconf _NPROCESSORS_ONLN)
# A file that was compiled before, in any checkout, is not compiled again.
CACHED = $(if $(findstring ccache,$(CC)),,$(if $(shell command -v ccache),ccache ))
export CCACHE_BASEDIR ?= $(CURDIR)
export CCACHE_NOHASHDIR ?= 1
STRICT = WERROR=-Werror CC="$(CACHED)$(CC)" CXX="$(CACHED)$(CXX)" CFLAGS="-g1 $(CFLAGS)" CXXFLAGS="-g1 $(CXXFLAGS)"
HAS_CLANG := $(shell command -v clang)
ASAN_CC = CC="$(CACHED)$(patsubst %gcc,%clang,$(CC))" CXX="$(CACHED)$(patsubst %g++,%clang++,$(CXX))"
ASAN_FLAGS = -fsanitize=address,undefined -fno-sanitize-recover=all \
	$(if $(HAS_CLANG),-fno-sanitize=vptr -fsanitize-coverage=inline-8bit-counters$(comma)pc-table)
comma = ,
ASAN = WERROR=-Werror BUILD=$(BUILD)/asan $(if $(HAS_CLANG),$(ASAN_CC) OPT=-O0 CORE_OPT="-O1 -Wno-pass-failed" CFLAGS=-g1,OPT=-Og CFLAGS="-g1 -w") CXXFLAGS=-g1 \
	TEST_WARN=-w CPPFLAGS=-DSH_SANITIZE SAN="$(ASAN_FLAGS)"
SUBMAKE = @$(MAKE) --no-print-directory -j$(JOBS)
RUN = SCANHEAD=$(BUILD)/test/scanhead READERS=$(READERS)
# `make test T=test_ring` builds and runs that one alone, of any folder. A script does as well: T=check_includes.
T ?=
#? test              all tests; T=test_ring one alone, THOROUGH=1 in full depth, DEPS=no installs nothing
ifeq ($(T),)
test: deps-test
	@$(MAKE) --no-print-directory DEPS_ARE_THERE=1 $(READERS)/installed & status=0; \
	$(MAKE) --no-print-directory -j$(JOBS) $(STRICT) BUILD=$(BUILD)/test JOIN=shipped test-programs || status=1; wait; exit $$status
	$(if $(HAS_CLANG),,@echo "no clang: its warnings are not looked at")
	@$(MAKE) --no-print-directory $(READERS)/pcl_vlp16 & status=0; \
	$(MAKE) --no-print-directory -j$(JOBS) $(ASAN) JOIN=unit objects test-unit-programs $(BUILD)/asan/scanhead $(if $(HAS_CLANG),fuzz-objects) || status=1; wait; exit $$status
	$(if $(HAS_CLANG),@$(MAKE) --no-print-directory -j$(JOBS) $(TSAN_SHORT))
	@$(RUN) sh tests/run_all.sh $(BUILD)
else
ONE = $(patsubst $(BUILD)/%,%,$(filter %/$(T),$(TESTS)))
SCRIPT = $(wildcard tests/$(T).sh tests/guest/$(T).sh tests/page/$(T).sh)
test: $(if $(ONE)$(SCRIPT),deps)
	@[ -n '$(ONE)$(SCRIPT)' ] || { echo "T=$(T): no tests/*/$(T).c, and no $(T).sh in tests, tests/guest or tests/page" >&2; exit 2; }
	$(SUBMAKE) $(STRICT) BUILD=$(BUILD)/test $(if $(filter-out tests/unit/%,$(ONE))$(SCRIPT),all $(BUILD)/test/bench) $(ONE:%=$(BUILD)/test/%) \
		$(if $(filter tests/guest/%,$(SCRIPT)),$(patsubst $(BUILD)/%,$(BUILD)/test/%,$(call PROGRAMS,guest)))
	@$(RUN) BUILD=$(BUILD) bash tests/run_tap.sh $(ONE:%=$(BUILD)/test/%) $(SCRIPT)
endif
#? test-unit         the tests of a folder: test-unit, test-wire, test-accuracy, test-stability, test-guest
test-unit test-wire test-accuracy test-stability test-guest: deps
	$(SUBMAKE) $(STRICT) BUILD=$(BUILD)/test test-programs
	@$(RUN) sh tests/run_all.sh $(BUILD) $(@:test-%=%)

# The other end of a usbredir channel goes, comes back and resets 1,000 times (in `make test` 20 times).
#? soak-usb          1,000 times a USB cable is pulled and put back
soak-usb: deps
	@$(MAKE) --no-print-directory -j2 $(STRICT) BUILD=$(BUILD)/test all $(BUILD)/test/tests/wire/test_usb_soak
	@TEST_LIMIT_S=7200 USB_SOAK_EVENTS=1000 SCANHEAD=$(BUILD)/test/scanhead $(BUILD)/test/tests/wire/test_usb_soak

# This kills recorders and fills disks at N random moments for each format (`make test`: one of each). It takes some
# minutes.
N ?= 200
#? repair            N=200 killed recorders and full disks for each format
repair: deps-build
	@$(MAKE) --no-print-directory -j2 $(STRICT) BUILD=$(BUILD)/test all $(BUILD)/test/tests/wire/test_repair
	@TEST_LIMIT_S=7200 REPAIR_N=$(N) $(RUN) $(BUILD)/test/tests/wire/test_repair

# This reads 600 broken meshes, with and without sanitizers, in half a minute. `make test` tries one in 30 with them.
#? test-hostile      600 broken meshes
test-hostile: deps
	@$(MAKE) --no-print-directory -j2 $(STRICT) BUILD=$(BUILD)/test $(BUILD)/test/tests/unit/test_hostile_files
	@$(MAKE) --no-print-directory -j2 $(ASAN) $(BUILD)/asan/tests/unit/test_hostile_files
	@TEST_LIMIT_S=7200 HOSTILE_EVERY=1 $(BUILD)/test/tests/unit/test_hostile_files
	@TEST_LIMIT_S=7200 HOSTILE_EVERY=1 $(BUILD)/asan/tests/unit/test_hostile_files

# This compares what a station sees, by its map and by the BVH, in 50,000 random scenes. It takes some minutes.
#? test-sight        50,000 random scenes: what a station sees, by its map and by the BVH
test-sight: deps
	@$(MAKE) --no-print-directory -j2 $(STRICT) BUILD=$(BUILD)/test $(BUILD)/test/tests/accuracy/test_sight
	@TEST_LIMIT_S=7200 SIGHT_SCENES=50000 $(BUILD)/test/tests/accuracy/test_sight

# A million pulses over each kind of USB have the hash that TCP gives. It takes some minutes in an emulated machine.
#? test-usb-million  a million pulses over each kind of USB
test-usb-million: deps
	@$(MAKE) --no-print-directory -j2 $(STRICT) BUILD=$(BUILD)/test test-programs
	@SCANHEAD=$(BUILD)/test/scanhead BUILD=$(BUILD) GUEST_PAN_DEG_S=0.4 GUEST_LIMIT_S=1200 \
		bash tests/run_tap.sh -t 2700 tests/guest/guest.sh

# ---- figures: speed and leaks; speed against accuracy, each method
DEPS_CHART = gnuplot-nox
#? bench             speed, and leaks of 10^8 rays; also bench-beam, -plain, -copies, -live, -loading, -loop, -kernels, -page, -panorama, -velodyne, -waves
bench: deps-build
	@$(MAKE) --no-print-directory -j2 $(BUILD)/bench
	@$(BUILD)/bench --scenes 10k,100k,1M,10M,house,garden --reach --leaks 1e8 -o $(BUILD)/bench.json
	@$(MAKE) --no-print-directory bench-speed
# Each program of the chart writes its panel's rows; the first one the head of the table.
CHART = $(BUILD)/chart/speed_accuracy
CHARTS = $(patsubst %,$(BUILD)/tests/bench/%,chart chart_moving chart_sight chart_georef chart_widths beam waveform waveform_detect)
# This measures footprints: cost, and error against 1,000 sub-rays. It takes a few minutes.
bench-beam: deps-build
	@$(MAKE) --no-print-directory -j2 $(BUILD)/tests/bench/beam
	@$(BUILD)/tests/bench/beam house wires foliage leaves
# Each of these runs one program. plain: effects that are configured and not needed change the cost of the plain cast
# by at most 5 %. copies: the memory of a forest of copies, and the cost of a ray compared with a single tree.
# velodyne: the encoder of VLP-16 data packets, ns a firing. waves: waveforms on the wire, ns a window.
#? bench-waveform    samples of full waveforms: ns a pulse by spread and window
bench-plain bench-copies bench-velodyne bench-waves bench-waveform: bench-%: deps-build
	@$(MAKE) --no-print-directory -j2 $(BUILD)/tests/bench/$*
	@$(BUILD)/tests/bench/$*
# This records a panorama of 0.1 degrees to files on one processor, and compares the time with that of Embree alone. The
# last run writes PLY with nothing but coordinates, as float.
PANORAMA = taskset -c $(shell expr $(JOBS) - 1) $(BUILD)/tests/bench/panorama --set loop.threads=1
bench-panorama: deps-build
	@$(MAKE) --no-print-directory -j2 $(BUILD)/tests/bench/panorama
	@$(PANORAMA) --ending none,.ply,.las,.e57
	@$(PANORAMA) --columns xyz,float
	@$(PANORAMA) --lines --ending none,.las
# This compares the speed with that of HELIOS++, which isn't part of scanhead and is named by
# HELIOS="--helios PROGRAM --assets FOLDER". A round takes ten minutes.
HELIOS ?=
bench-helios: deps-build
	@$(MAKE) --no-print-directory -j2 all $(BUILD)/tests/bench/write_mesh
	@python3 tests/bench/helios.py $(HELIOS)
# This measures what a browser costs a head that runs at its limit, and how fast the page is. It takes some minutes.
bench-page: deps-build deps-browser
	@$(MAKE) --no-print-directory -j2 all $(BUILD)/tests/bench/write_mesh
	@SCANHEAD=$(BUILD)/scanhead node tests/bench/page.mjs $(PAGE)
# The page in three widths and both themes, to be looked at.
#? page-pictures     the page of a web link in three widths and both themes
page-pictures: deps-build deps-browser
	@$(MAKE) --no-print-directory -j2 all
	@SCANHEAD=$(BUILD)/scanhead node tests/page/pictures.mjs --out $(BUILD)/pictures
# This measures the arithmetic around the cast, ns a pulse: for this CPU, and for an x86 without AVX-512.
bench-kernels: deps-build
	@$(MAKE) --no-print-directory -j2 $(BUILD)/tests/bench/kernels
	@$(BUILD)/tests/bench/kernels
	+@$(call make_avx2,tests/bench/kernels)
	@$(if $(AVX2),echo "AVX2:" && $(AVX2)/tests/bench/kernels)
# This measures the processor time that the real loop takes a pulse, with and without stream_sha256. WITH names other
# programs, which are measured in the same rounds: make bench-loop WITH="'/path/scanhead' '/other --option'".
WITH ?=
bench-loop: deps-build
	@$(MAKE) --no-print-directory -j2 all $(BUILD)/tests/bench/loop_cost
	@$(BUILD)/tests/bench/loop_cost $(BUILD)/scanhead '$(BUILD)/scanhead --no-hash' $(WITH)
# This measures `check` of meshes of 10 million triangles, and compares it with Embree's build of their BVH.
bench-loading: deps-build
	@$(MAKE) --no-print-directory -j2 all $(BUILD)/tests/bench/loading
	@$(BUILD)/tests/bench/loading --program $(BUILD)/scanhead $(LOADING)
#? chart             speed against accuracy, each method: config/speed_accuracy*.png
chart: deps-build
	$(call install_missing,$(DEPS_CHART))
	@$(MAKE) --no-print-directory -j2 $(CHARTS)
	@mkdir -p $(BUILD)/chart
	$(BUILD)/tests/bench/chart > $(CHART).csv
	$(BUILD)/tests/bench/chart_moving >> $(CHART).csv
	$(BUILD)/tests/bench/chart_sight >> $(CHART).csv
	$(BUILD)/tests/bench/chart_georef >> $(CHART).csv
	$(BUILD)/tests/bench/chart_widths >> $(CHART).csv
	$(BUILD)/tests/bench/beam --chart house wires foliage >> $(CHART).csv
	$(BUILD)/tests/bench/waveform --chart >> $(CHART).csv
	$(BUILD)/tests/bench/waveform_detect --chart >> $(CHART).csv
	gnuplot -e "csv='$(CHART).csv'; base='$(CHART)'" tests/bench/chart.gp
	gnuplot -e "csv='$(CHART).csv'; base='$(CHART)_more'" tests/bench/chart_more.gp
	gnuplot -e "csv='$(CHART).csv'; base='$(CHART)_moving'" tests/bench/chart_moving.gp
	gnuplot -e "csv='$(CHART).csv'; base='$(CHART)_waveform'" tests/bench/chart_waveform.gp
objects: $(EVERYTHING)
test-unit-programs test-programs: $(BUILD)/tests/joined
test-programs: all $(BUILD)/bench $(call PROGRAMS,guest) $(FIGURES)

# Long tests and measurements have rules beside them.
include $(wildcard tests/*/*.mk config/*/*.mk)

# The readers of IFC are installed without the files that only browsers need. A build in a folder of build/ uses the
# readers in build/ifc.
IFC_BUILT = $(patsubst %/installed,%,$(firstword $(wildcard $(IFC_READERS)/installed $(BUILD)/../ifc/installed)))
IFC_FILES = $(addprefix node_modules/web-ifc/,package.json LICENSE.md web-ifc-api-node.js web-ifc-node.wasm) \
	$(addprefix node_modules/@ifc-lite/wasm/,package.json LICENSE pkg/ifc-lite.js pkg/ifc-lite_bg.wasm)
# BUILT=yes installs existing files, whatever flags they were built with and by whichever user.
BUILT ?= no
#? install           into PREFIX=/usr/local, below DESTDIR; BUILT=yes builds nothing
check-place: export GIVEN_PREFIX = $(PREFIX)
check-place: export GIVEN_DESTDIR = $(DESTDIR)
check-place:
	@case "$$GIVEN_PREFIX$$GIVEN_DESTDIR" in *[\"\$$\`\\\|\&\#[:cntrl:]]*) \
		printf '%s\n' 'make install: PREFIX or DESTDIR has a character of "$$`\|&# or a control character; all others are allowed' >&2; exit 1;; esac
	@case "$$GIVEN_PREFIX" in ""|/*) ;; *) \
		printf '%s\n' "make install: PREFIX=$$GIVEN_PREFIX is relative; a path that begins with / is allowed" >&2; exit 1;; esac
INSTALL_LIST = $(PREFIX)/share/scanhead/installed.txt
# A trial (make -n) shows what would be installed, and makes no folder.
IS_TRIAL = $(findstring n,$(filter-out --%,$(firstword -$(MAKEFLAGS))))
STAGED = umask 022; stage=$$(mktemp -d) || exit; trap 'rm -rf "$$stage"' EXIT; trap 'exit 1' HUP INT TERM; \
	$(MAKE) --no-print-directory stage STAGE="$$stage" && sh config/packaging/install.sh "$$stage" "$(DESTDIR)" "$(INSTALL_LIST)"
install: check-place $(if $(filter yes,$(BUILT)),,all)
	@$(if $(IS_TRIAL),$(MAKE) --no-print-directory stage STAGE=STAGE,$(STAGED))
#? uninstall         removes what make install has put below PREFIX and DESTDIR
uninstall: check-place
	@sh config/packaging/install.sh --remove "$(DESTDIR)" "$(INSTALL_LIST)"
# All that is installed is put into STAGE first, so that nothing is installed where a part is missing.
stage:
	@[ -n "$(STAGE)" ] || { echo "make stage: STAGE is the folder that gets the files" >&2; exit 1; }
	install -d "$(STAGE)$(PREFIX)/bin" "$(STAGE)$(PREFIX)/$(LIB)" "$(STAGE)$(PREFIX)/include" "$(STAGE)$(HEADS_DIR)" \
		"$(STAGE)$(SCENES_DIR)" "$(STAGE)$(FAULTS_DIR)" "$(STAGE)$(CAMPAIGN_DIR)" "$(STAGE)$(UDEV_DIR)" "$(STAGE)$(PC_DIR)" "$(STAGE)$(PREFIX)/share/scanhead/python" \
		"$(STAGE)$(WIRESHARK_DIR)" "$(STAGE)$(UNIT_DIR)" "$(STAGE)$(COMPLETION_DIR)" \
		"$(STAGE)$(MAN_DIR)/man1" "$(STAGE)$(MAN_DIR)/man3" "$(STAGE)$(MAN_DIR)/man5"
	install $(BUILD)/scanhead $(BUILD)/scanheadd "$(STAGE)$(PREFIX)/bin/"
	install -m 644 $(BUILD)/libscanhead.a "$(STAGE)$(PREFIX)/$(LIB)/"
	install $(BUILD)/libscanhead.so "$(STAGE)$(PREFIX)/$(LIB)/libscanhead.so.1"
	ln -sf libscanhead.so.1 "$(STAGE)$(PREFIX)/$(LIB)/libscanhead.so"
	install -m 644 drivers/host/scanhead.h "$(STAGE)$(PREFIX)/include/"
	install -m 644 drivers/host/python/scanhead.py "$(STAGE)$(PREFIX)/share/scanhead/python/"
	install -m 644 drivers/protocol/wireshark/scanhead.lua "$(STAGE)$(WIRESHARK_DIR)/"
	install -m 644 config/heads/*.yaml "$(STAGE)$(HEADS_DIR)/"
	install -m 644 config/scenes/glass_room.obj "$(STAGE)$(SCENES_DIR)/"
	install -m 644 config/faults/*.yaml "$(STAGE)$(FAULTS_DIR)/"
	install config/campaign/*.sh "$(STAGE)$(CAMPAIGN_DIR)/"
	install -d "$(STAGE)$(IFC_DIR)"
	install -m 644 core/import/ifc/*.mjs core/import/ifc/package.json core/import/ifc/package-lock.json core/import/ifc/.npmrc "$(STAGE)$(IFC_DIR)/"
	if [ -n '$(IFC_BUILT)' ]; then for f in $(IFC_FILES); do install -D -m 644 "$(IFC_BUILT)/$$f" "$(STAGE)$(IFC_DIR)/$$f" || exit; done; \
	else echo "without the readers of IFC, which npm did not install: Assimp reads it"; fi
	install -D -m 644 LICENSE "$(STAGE)$(PREFIX)/share/doc/scanhead/LICENSE"
	install -m 644 drivers/host/70-scanhead.rules "$(STAGE)$(UDEV_DIR)/"
	sed "s|@PREFIX@|$(subst %,%%,$(PREFIX))|" config/packaging/scanhead@.service.in > "$(STAGE)$(UNIT_DIR)/scanhead@.service"
	for d in d ""; do \
		pages=$$($(PRINTER)$$d help --man list) && for p in $$pages; do \
			$(PRINTER)$$d help --man $$p > "$(STAGE)$(MAN_DIR)/man$${p##*.}/$$p" || exit; done && \
		$(PRINTER)$$d help --completion bash > "$(STAGE)$(COMPLETION_DIR)/scanhead$$d" || exit; done
	awk -f drivers/host/libscanhead.3.awk drivers/host/scanhead.h > "$(STAGE)$(MAN_DIR)/man3/libscanhead.3"
	sed "s|@PREFIX@|$(PREFIX)|; s|@LIB@|$(LIB)|; s|@VERSION@|$$(sed -n 's/^#define SCANHEAD_VERSION  *"\(.*\)"$$/\1/p' \
		drivers/host/scanhead.h)|" drivers/host/libscanhead.pc.in > "$(STAGE)$(PC_DIR)/libscanhead.pc"
#? format            clang-format on all sources
format:
	clang-format -i $$(git ls-files '*.c' '*.h' '*.cpp')
#? clean             remove build/
clean:
	rm -rf $(BUILD)
#? help              these lines
help:
	@sed -n 's/^#? /make /p' $(filter Makefile %.mk,$(MAKEFILE_LIST))
.PHONY: ALWAYS all scanheadd ifc-readers deps deps-test deps-build deps-guest deps-browser demo test test-unit test-wire test-accuracy test-stability test-guest soak-usb repair \
	test-usb-million test-hostile test-sight objects test-unit-programs test-programs bench bench-beam bench-plain bench-copies bench-velodyne bench-waves bench-waveform bench-page page-pictures bench-loop bench-loading bench-kernels bench-panorama bench-helios chart install uninstall check-place stage format clean help
.SECONDARY:
-include $(shell find $(patsubst %,$(BUILD)/%,core drivers firmware_sim tests) -name '*.d' 2>/dev/null)
