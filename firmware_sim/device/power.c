/* SPDX-License-Identifier: MIT */
/* Power and boots: power cycles, and injected faults of a boot.
 *
 * Device time, scan numbers and the stations' places go on over a power cycle, and so does the time of day, which has a
 * battery. All else is as at power-up. A reboot by command is a power cycle of one tick. Protocols whose devices count
 * their time from power-up use device_last_power(). */
#include <string.h>

#include "firmware_sim/device/device_state.h"

static int64_t time_of(const struct device *device, uint64_t tick)
{
    return (int64_t)tick * device->tick_ns;
}

static void end_slow_boots(struct device *device, uint64_t tick)
{
    struct head_fault *f = NULL;
    while ((f = head_faults_next(&device->head_faults, FAULT_SLOW_BOOT, f)) != NULL) {
        f->active = 0;
        head_faults_note(&device->head_faults, f, time_of(device, tick), 1);
    }
}

static struct device_power_up_at *newest(struct device_power *power)
{
    return &power->up[(power->n_ups - 1) % DEVICE_MAX_POWER_UPS];
}

static void set_on_tick(struct device *device, uint64_t tick)
{
    device->machine.due_tick = device->power.on_tick = newest(&device->power)->on_tick = tick;
}

/* Turns power off. No event reports the end of the scan: readers see that it stops. */
static void turn_off(struct device *device, uint64_t tick, uint64_t until_tick)
{
    struct device_scan *scan = &device->scan;
    if (scan->on) device_end_beam(&device->beam, time_of(device, tick - scan->tick0));
    if (scan->on) scan->end_tick = tick;
    scan->on = scan->stop_requested = scan->describe = scan->anchor_lost = 0;
    end_slow_boots(device, tick);
    device->events.n = device->events.dropped = 0;
    device->events.held = 0;
    memset(device->events.errors, 0, sizeof device->events.errors);
    device_transition(device, HEAD_EV_POWER_OFF, tick);
    device->power.off_tick = tick;
    const struct device_power_up_at next = {.off_tick = tick, .near_wrap = newest(&device->power)->near_wrap};
    device->power.n_ups++;
    *newest(&device->power) = next;
    set_on_tick(device, until_tick);
}

static void set_near_wrap(struct device *device, uint64_t tick)
{
    const struct head_fault *f = NULL;
    uint32_t *near_wrap = &newest(&device->power)->near_wrap;
    *near_wrap = 0;
    while ((f = head_faults_at(&device->head_faults, FAULT_COUNTERS_HIGH, time_of(device, tick), f)) != NULL)
        *near_wrap = fault_n(&f->fault);
}

void device_first_power(struct device *device)
{
    static const struct head_faults_tick first = {0};
    head_faults_step(&device->head_faults, 0, &first); /* only takes over the list */
    device->power.n_ups = 1;
    set_near_wrap(device, 0);
    device_start_date(device, 0);
    device_transition(device, HEAD_EV_POWER_ON, 0);
}

static void turn_on(struct device *device, uint64_t tick)
{
    struct command_device *cmd = &device->cmd;
    cmd->settings = cmd->defaults;
    cmd->control = 0;
    cmd->frames_done = 0;
    memset(&cmd->queue, 0, sizeof cmd->queue);
    memset(device->station_scans, 0, device->site->n_stations * sizeof *device->station_scans);
    set_near_wrap(device, tick);
    device_start_date(device, time_of(device, tick));
    device_before_scans(device);
    device_transition(device, HEAD_EV_POWER_ON, tick);
}

/* Begins a boot, in its first tick. */
static void begin_boot(struct device *device, uint64_t tick)
{
    struct head_faults *faults = &device->head_faults;
    const int64_t t_ns = time_of(device, tick);
    struct head_fault *f = NULL;
    device->power.boot_begins = 0;
    if (fault_board_version(device->faults) == 0) return;
    while ((f = head_faults_at(faults, FAULT_SLOW_BOOT, t_ns, f)) != NULL) {
        device->machine.due_tick += device_ticks_of(device, 1e-3 * f->fault.for_ms);
        f->active = 1;
        head_faults_note(faults, f, t_ns, 0);
    }
    while ((f = head_faults_at(faults, FAULT_COUNTERS_HIGH, t_ns, f)) != NULL)
        head_faults_note(faults, f, t_ns, 0);
}

int device_end_boot(struct device *device, uint64_t tick)
{
    struct head_faults *faults = &device->head_faults;
    const int64_t t_ns = time_of(device, tick);
    struct head_fault *f = NULL;
    int failed = 0;
    if (fault_board_version(device->faults) == 0) return 0;
    end_slow_boots(device, tick);
    while ((f = head_faults_at(faults, FAULT_SELF_TEST, t_ns, f)) != NULL) {
        head_faults_note(faults, f, t_ns, 0);
        failed = 1;
    }
    if (!failed) return 0;
    command_queue_push(&device->cmd.queue, CMD_E_SELF_TEST, "at the end of boot; *RST goes on without it");
    device_push_error(&device->events, 0, CMD_E_SELF_TEST, command_error_text(CMD_E_SELF_TEST));
    device_transition(device, HEAD_EV_FAIL, tick);
    device->cmd.why_fault = "the self-test failed; *RST goes on without it";
    if (device->options.start && device->options.one_scan) device->over = 1; /* there will be no scan to wait for */
    if (device->scan.number == 0) device_count_duration(device, tick);
    return 1;
}

/* Returns the tick at which power comes back, if power goes off in this tick; 0 if it does not. */
static uint64_t goes_until(struct device *device, uint64_t tick)
{
    const struct head_fault *f = NULL;
    uint64_t until_tick = device->power.reboots ? tick + 1 : 0;
    device->power.reboots = 0;
    if (fault_board_version(device->faults) == 0) return until_tick;
    while ((f = head_faults_next(&device->head_faults, FAULT_POWER_CYCLE, f)) != NULL) {
        const uint64_t tick1 = tick + device_ticks_of(device, 1e-3 * f->fault.for_ms);
        if (f->begins && tick1 > until_tick) until_tick = tick1; /* of two at once, the longer one decides */
    }
    return until_tick;
}

/* Where power would come back and go again with one tick, it stays off: links must see it go and come in turn. */
void device_run_power(struct device *device, uint64_t tick, struct device_work *work)
{
    const uint64_t until_tick = goes_until(device, tick);
    work->power = DEVICE_POWER_STAYS;
    if (device->machine.state == HEAD_OFF) {
        if (until_tick > device->power.on_tick) set_on_tick(device, until_tick);
        if (device->machine.due_tick <= tick) {
            turn_on(device, tick);
            work->power = DEVICE_POWER_COMES;
        }
    } else if (until_tick != 0) {
        turn_off(device, tick, until_tick);
        work->power = DEVICE_POWER_GOES;
    }
    if (device->power.boot_begins) begin_boot(device, tick);
}

int device_is_dead(const struct device *device, uint64_t released)
{
    const struct device_power *power = &device->power;
    return power->on_tick != 0 && device->next_tick > power->off_tick && released < power->on_tick;
}

struct device_power_up device_power_at(const struct device *device, int64_t t_ns)
{
    const struct device_power *power = &device->power;
    const uint32_t kept = power->n_ups < DEVICE_MAX_POWER_UPS ? power->n_ups : DEVICE_MAX_POWER_UPS;
    uint32_t i = power->n_ups - 1; /* the oldest one that is kept also covers the time before */
    while (i > power->n_ups - kept && time_of(device, power->up[i % DEVICE_MAX_POWER_UPS].off_tick) > t_ns)
        i--;
    const struct device_power_up_at *last = &power->up[i % DEVICE_MAX_POWER_UPS];
    const int64_t on_ns = time_of(device, last->on_tick);
    return (struct device_power_up){on_ns, i + (on_ns <= t_ns), last->near_wrap};
}

struct device_power_up device_last_power(void *self, int64_t t_ns)
{
    struct device *device = self;
    pthread_mutex_lock(&device->lock);
    const struct device_power_up last = device_power_at(device, t_ns);
    pthread_mutex_unlock(&device->lock);
    return last;
}

double device_window_loss_db(void *self)
{
    struct device *device = self;
    pthread_mutex_lock(&device->lock);
    const double loss_db = device_beam_loss_db(&device->beam);
    pthread_mutex_unlock(&device->lock);
    return loss_db;
}
