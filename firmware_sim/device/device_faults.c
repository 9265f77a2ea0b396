/* Faults on request: the board of the run, and the commands that change it. */
#include <stdio.h>
#include <string.h>

#include "firmware_sim/device/device_state.h"

static void write_note(void *ctx, const struct fault_note *note)
{
    const struct device *device = ctx;
    char text[TRUTH_TEXT_LEN];
    truth_text(note, text);
    if (device->journal.out != NULL) journal_note(device->journal.out, text);
}

static int add_fault(void *owner, const char *text, uint32_t *number, char *why, size_t len)
{
    struct device *device = owner;
    struct fault fault;
    struct sh_err err;
    int rc = config_read_fault(device->site->cfg, text, &fault, &err);
    if (rc == SH_OK)
        rc = fault_board_add(device->faults, &fault, (int64_t)device->next_tick * device->tick_ns, number, &err);
    if (rc == SH_OK) return 0;
    snprintf(why, len, "%s", err.text);
    return -1;
}

static uint32_t remove_fault(void *owner, uint32_t number)
{
    const struct device *device = owner;
    return fault_board_end(device->faults, number, (int64_t)device->next_tick * device->tick_ns);
}

static int count_injected(void *owner, uint32_t number, uint64_t *n)
{
    struct fault_board *board = ((struct device *)owner)->faults;
    *n = fault_board_injected(board, number);
    return number <= fault_board_last(board) ? 0 : -1;
}

static void list_faults(void *owner, char *text, size_t len)
{
    struct fault_entry entry[FAULT_MAX];
    uint32_t n, i = 0;
    size_t used = 0;
    text[0] = '\0';
    fault_board_copy(((struct device *)owner)->faults, entry, &n);
    for (; i < n; i++) {
        char one[64];
        const size_t size = (size_t)snprintf(one, sizeof one, "%s%u %s", i > 0 ? ", " : "", entry[i].number,
                                             fault_names[entry[i].fault.kind]);
        if (used + size + sizeof ", and 32 more" > len) break;
        memcpy(text + used, one, size + 1);
        used += size;
    }
    if (i < n) snprintf(text + used, len - used, ", and %u more", n - i);
}

static const struct command_faults COMMANDS = {add_fault, remove_fault, count_injected, list_faults};

int device_open_faults(struct device *device, struct sh_err *err)
{
    const int rc = fault_board_create(&device->site->cfg->faults, device->options.truth, &device->faults, err);
    if (rc != SH_OK) return rc;
    fault_board_listen(device->faults, write_note, device);
    head_faults_init(&device->head_faults, device->faults, device->tick_ns);
    device->cmd.faults = &COMMANDS;
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
