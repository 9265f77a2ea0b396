# SPDX-License-Identifier: MIT
# This runs every scenario of config/faults over each kind of link, with our own client. usb runs in an emulated machine
# if there is one. A table comes at the end. The soak takes some ten minutes.
SOAK_S ?= 30
#? soak              long runs that are judged at their end
soak: soak-scenarios soak-long
soak-scenarios: deps-build
	@$(MAKE) --no-print-directory -j2 all
	@sh tests/soak/soak.sh $(SOAK_S) $(BUILD)

# This records an hour of device time at 10 kHz, replays it at pace fast, and records it again. replay-hour takes half a
# minute, and 1.8 GB in build/ meanwhile.
REPLAY_S ?= 3600
#? replay-hour       an hour of a recording, replayed
replay-hour: deps-build
	@$(MAKE) --no-print-directory -j2 all
	@sh tests/soak/replay_hour.sh $(REPLAY_S) $(BUILD)

# For ten minutes one head gives 2.2 million pulses a second on all links, beside a head of each maker. Clients come,
# go, stall and misbehave, and faults strike. The head is judged at the end. SOAK_LONG_S=3600 runs it for an hour.
SOAK_LONG_S ?= 600
soak-long: deps-build
	$(call install_missing,python3)
	@$(MAKE) --no-print-directory -j2 all
	@python3 tests/soak/long.py --seconds $(SOAK_LONG_S) --scanhead $(BUILD)/scanhead --out $(BUILD)/soak-long

# This aims 10^9 rays at edges and corners, and none may leak. `make test` aims 6 x 10^5.
LEAKS ?= 1e9
#? leaks             LEAKS=1e9 rays aimed at edges and corners: none may pass
leaks: deps-build
	@$(MAKE) --no-print-directory -j2 $(BUILD)/bench
	@$(BUILD)/bench --scenes 10k --leaks $(LEAKS) -o $(BUILD)/leaks.json
.PHONY: soak soak-scenarios soak-long replay-hour leaks
