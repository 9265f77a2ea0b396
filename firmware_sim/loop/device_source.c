/* SPDX-License-Identifier: MIT */
/* A simulated head as a source of the loop (source.h), by the functions of device.h. The other source is a recording
 * (firmware_sim/replay). */
#include "firmware_sim/loop/source.h"

#include "firmware_sim/device/scanner_clock.h"

static uint64_t scans(void *self)
{
    return device_last_scan(self, NULL);
}

const struct loop_source_ops loop_device_source = {
    .command = device_command,
    .overlong = device_overlong,
    .session_opened = device_session_opened,
    .session_closed = device_session_closed,
    .report = device_report,
    .faults = device_faults,
    .command_once = device_command_once,
    .date_ns = device_date_ns,
    .next_fix_ns = device_next_fix_ns,
    .fix = device_fix,
    .rests_from = device_rests_from,
    .last_power = device_last_power,
    .pps = device_pps,
    .store = device_store,
    .stored = device_stored,
    .window_loss_db = device_window_loss_db,
    .tick_ns = device_tick_ns,
    .counters = device_counters,
    .scans = scans,
    .power_up = device_power_up,
    .end = device_end,
    .files_fill = device_files_fill,
    .close_files = device_close_journal,
};
