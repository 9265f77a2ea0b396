/* SPDX-License-Identifier: MIT */
/* The head that computes, as a source of the loop: the functions of device.h, each by a void pointer. */
#include "firmware_sim/loop/source.h"

#include "firmware_sim/device/scanner_clock.h"

static void command(void *self, uint32_t session, const char *line, uint64_t released, struct command_result *out)
{
    device_command(self, session, line, released, out);
}

static void overlong(void *self, uint32_t session, struct command_result *out)
{
    device_overlong(self, session, out);
}

static void session_opened(void *self, uint32_t session, const char *who)
{
    device_session_opened(self, session, who);
}

static void session_closed(void *self, uint32_t session, const char *who, int partial)
{
    device_session_closed(self, session, who, partial);
}

static void device_source_report(void *self, int number, const char *text)
{
    device_report(self, number, text);
}

static struct fault_board *faults(const void *self)
{
    return device_faults(self);
}

static void command_once(void *self, uint32_t session, const char *line, uint64_t released, struct command_result *out)
{
    device_command_once(self, session, line, released, out);
}

static int64_t utc_ns(void *self, int64_t t_ns)
{
    return device_utc_ns(self, t_ns);
}

static int64_t date_ns(void *self, int64_t t_ns)
{
    return device_date_ns(self, t_ns);
}

static int64_t next_fix_ns(void *self, int64_t t_ns)
{
    return device_next_fix_ns(self, t_ns);
}

static int fix(void *self, int64_t t_ns, struct nmea_fix *fix)
{
    return device_fix(self, t_ns, fix);
}

static uint64_t rests_from(void *self)
{
    return device_rests_from(self);
}

static struct device_power_up last_power(void *self)
{
    return device_last_power(self);
}

static enum protocol_pps pps(void *self, int64_t t_ns, int64_t *hour_ns)
{
    return device_pps(self, t_ns, hour_ns);
}

static int store(void *self, const char *name, const char *text)
{
    return device_store(self, name, text);
}

static int stored(const void *self, const char *name, char text[SETTINGS_FILE_TEXT])
{
    return device_stored(self, name, text);
}

static double window_loss_db(void *self)
{
    return device_window_loss_db(self);
}

static int64_t tick_ns(const void *self)
{
    return device_tick_ns(self);
}

static struct device_counters *counters(void *self)
{
    return device_counters(self);
}

static uint64_t scans(void *self)
{
    return device_last_scan(self, NULL);
}

static int power_up(void *self, int64_t now_ns, const char **warning, struct sh_err *err)
{
    return device_power_up(self, now_ns, warning, err);
}

static void device_source_end(void *self)
{
    device_end(self);
}

static int files_fill(const void *self)
{
    return device_files_fill(self);
}

static int close_files(void *self, struct sh_err *err)
{
    return device_close_journal(self, err);
}

const struct loop_source_ops loop_device_source = {
    .command = command,
    .overlong = overlong,
    .session_opened = session_opened,
    .session_closed = session_closed,
    .report = device_source_report,
    .faults = faults,
    .command_once = command_once,
    .utc_ns = utc_ns,
    .date_ns = date_ns,
    .next_fix_ns = next_fix_ns,
    .fix = fix,
    .rests_from = rests_from,
    .last_power = last_power,
    .pps = pps,
    .store = store,
    .stored = stored,
    .window_loss_db = window_loss_db,
    .tick_ns = tick_ns,
    .counters = counters,
    .scans = scans,
    .power_up = power_up,
    .end = device_source_end,
    .files_fill = files_fill,
    .close_files = close_files,
};
