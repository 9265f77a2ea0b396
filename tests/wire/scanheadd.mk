# SPDX-License-Identifier: MIT
# This runs the wire tests of links, protocols, faults and replay with scanheadd as the head. The run takes minutes.
# Clients are those of scanhead.
SCANHEADD_TESTS = pty split sessions join half_closed slow_reader stalled_files loopback step step_links flood three_heads \
	cola_stream cola_reboot grabber_hokuyo grabber_sick grabber_velodyne gnss gpsd clients python samples same_stream \
	usb_devices usb_identity usb_capacity knobs overrun reboot signals \
	faults fault_links fault_times head_faults beam_faults beam_faults_heads reply_faults unit_faults \
	replay_commands replay_faults replay_files replay_hurt replay_options replay_same replay_ticks
#? test-scanheadd    the wire tests of links, protocols, faults and replay, with scanheadd as the head
test-scanheadd: deps
	$(SUBMAKE) $(STRICT) BUILD=$(BUILD)/test test-programs
	@SCANHEAD=$(BUILD)/test/scanheadd READERS=$(READERS) bash tests/run_tap.sh -t 1200 \
		tests/check_scanheadd.sh $(SCANHEADD_TESTS:%=$(BUILD)/test/tests/wire/test_%)
.PHONY: test-scanheadd
