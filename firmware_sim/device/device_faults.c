/* SPDX-License-Identifier: MIT */
/* Injected faults: the board of the run. */
#include "firmware_sim/config/config.h"
#include "firmware_sim/device/device_state.h"

static void write_note(void *ctx, const struct fault_note *note)
{
    const struct device *device = ctx;
    char text[TRUTH_TEXT_LEN];
    truth_text(note, text);
    if (device->journal.out != NULL) journal_note(device->journal.out, text);
}

int device_open_faults(struct device *device, struct sh_err *err)
{
    const int rc = fault_board_create(&device->site->cfg->faults, device->options.truth,
                                      &device->counters.lost_truth_lines, &device->faults, err);
    if (rc != SH_OK) return rc;
    fault_board_listen(device->faults, write_note, device);
    head_faults_init(&device->head_faults, device->faults, device->tick_ns);
    device->desk = (struct fault_desk){.cfg = device->site->cfg, .board = device->faults};
    device->cmd.faults = &fault_desk_commands;
    device->cmd.faults_owner = &device->desk;
    return SH_OK;
}

void device_run_faults(struct device *device, uint64_t tick, struct device_work *work)
{
    const struct head_faults_tick at = {.t_ns = (int64_t)tick * device->tick_ns,
                                        .has_pulses = device->scan.on,
                                        .pulse0 = device->scan.pulse_next,
                                        .n_pulses =
                                            1}; /* from the tick on that begins with the fault's pulse or later */
    if (head_faults_step(&device->head_faults, HEAD_FAULTS_CLOCK | HEAD_FAULT(FAULT_POWER_CYCLE), &at))
        device_run_clock_faults(device, tick);
    device_run_power(device, tick, work);
}

struct fault_board *device_faults(const struct device *device)
{
    return device->faults;
}
