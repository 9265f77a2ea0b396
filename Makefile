# scanhead: build/scanhead, build/libscanhead.{a,so}; make demo, make test do all their own set-up.
BUILD ?= build
ifeq ($(origin CC),default)
CC = gcc
endif
ifeq ($(origin CXX),default)
CXX = g++
endif
V ?= 0
Q_0 = @
Q = $(Q_$(V))
PREFIX ?= /usr/local
PKGS = yaml-0.1 libpng nettle
PKG_CFLAGS := $(shell pkg-config --cflags $(PKGS) 2>/dev/null)
PKG_LIBS := $(shell pkg-config --libs $(PKGS) 2>/dev/null)
OPT ?= -O3
WARN = -Wall -Wextra -Wconversion -Wshadow -Wstrict-prototypes -Wmissing-prototypes
CXXWARN = -Wall -Wextra -Wconversion -Wshadow
SAN ?=
WERROR ?= -Werror
# No contraction to FMA: the same numbers on every instruction set. errno and traps of libm are not used.
FP = -ffp-contract=off -fno-math-errno -fno-trapping-math
CPPFLAGS += -I. -D_GNU_SOURCE -MMD -MP
CFLAGS += -std=c11 $(OPT) -g $(FP) $(WARN) $(WERROR) -fPIC -pthread $(SAN) $(PKG_CFLAGS)
CXXFLAGS += -std=c++17 $(OPT) -g $(FP) $(CXXWARN) $(WERROR) -fPIC -pthread $(SAN)
LDLIBS = -lembree3 -lassimp -lGeographicLib $(PKG_LIBS) -lstdc++ -lm -pthread

CORE = $(wildcard core/*.c core/*/*.c)
SHIM = $(wildcard core/*/*.cpp)
PROTO = $(wildcard drivers/protocol/*.c)
LINK = $(wildcard drivers/link/*.c)
HOST = $(wildcard drivers/host/*.c)
FIRM = $(filter-out firmware_sim/main.c,$(wildcard firmware_sim/*.c))
OBJ = $(patsubst %,$(BUILD)/%.o,$(CORE) $(SHIM) $(PROTO) $(LINK) $(HOST) $(FIRM))
LIBOBJ = $(patsubst %,$(BUILD)/%.o,core/err.c $(PROTO) $(HOST))
UNIT = $(patsubst tests/unit/%.c,$(BUILD)/tests/%,$(wildcard tests/unit/test_*.c))

all: $(BUILD)/scanhead $(BUILD)/libscanhead.a $(BUILD)/libscanhead.so

$(BUILD)/%.c.o: %.c
	@mkdir -p $(@D)
	@echo "  CC    $<"
	$(Q)$(CC) $(CPPFLAGS) $(CFLAGS) -c $< -o $@
$(BUILD)/%.cpp.o: %.cpp
	@mkdir -p $(@D)
	@echo "  CXX   $<"
	$(Q)$(CXX) $(CPPFLAGS) $(CXXFLAGS) -c $< -o $@

$(BUILD)/libscanhead_all.a: $(OBJ)
	@rm -f $@
	@echo "  AR    $@"
	$(Q)$(AR) rcs $@ $^
$(BUILD)/libscanhead.a: $(LIBOBJ)
	@rm -f $@
	@echo "  AR    $@"
	$(Q)$(AR) rcs $@ $^
$(BUILD)/libscanhead.so: $(LIBOBJ)
	@echo "  LD    $@"
	$(Q)$(CC) -shared $(SAN) -o $@ $^ -lnettle -Wl,--version-script=drivers/host/libscanhead.map -Wl,--no-undefined -lm
$(BUILD)/scanhead: $(BUILD)/firmware_sim/main.c.o $(BUILD)/libscanhead_all.a
	@echo "  LD    $@"
	$(Q)$(CC) $(SAN) -o $@ $^ $(LDLIBS)
$(BUILD)/tests/%: tests/unit/%.c $(BUILD)/libscanhead_all.a
	@mkdir -p $(@D)
	@echo "  TEST  $@"
	$(Q)$(CC) $(CPPFLAGS) $(CFLAGS) -MF $@.d -o $@ $< $(BUILD)/libscanhead_all.a -lcmocka $(LDLIBS)

test-unit: $(UNIT)
	@for t in $(UNIT); do CMOCKA_MESSAGE_OUTPUT=TAP $$t || true; done
clean:
	rm -rf $(BUILD)
.PHONY: all test-unit clean
.SECONDARY:
-include $(shell find $(BUILD) -name '*.d' 2>/dev/null)
