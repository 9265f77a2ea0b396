/* SPDX-License-Identifier: MIT */
/* The device's time of day: PPS, the answers to TIME: queries, and the GNSS receiver. */
#include <stdio.h>

#include "firmware_sim/device/clock_faults.h"
#include "firmware_sim/device/device_state.h"

int device_power_up(struct device *device, int64_t now_ns, const char **warning, struct sh_err *err)
{
    pthread_mutex_lock(&device->lock); /* a client may ask for the time already */
    int rc = head_clock_power_up(&device->clock, now_ns, err);
    device->date.zero_ns = head_clock_ns(&device->clock, 0); /* the system's clock was not known before */
    pthread_mutex_unlock(&device->lock);
    *warning = device->clock.warning[0] != '\0' ? device->clock.warning : NULL;
    return rc;
}

int64_t device_gps_ns(const struct device *device, int64_t t_ns)
{
    return device->clock.source != EPOCH_NONE ? utc_gps_ns(head_clock_ns(&device->clock, t_ns)) : 0;
}

void device_say_pps(struct device *device, uint64_t tick)
{
    const struct head_clock *clock = &device->clock;
    int64_t t_ns = (int64_t)tick * device->tick_ns, edge_ns, tai_s;
    if (device->pps.n == 0 || device->power.on_tick == tick)
        pps_power_up(&device->pps, t_ns, device_has_no_pps(&device->head_faults, t_ns));
    if (clock->source == EPOCH_NONE || !head_clock_edge(clock, t_ns, t_ns + device->tick_ns, &edge_ns, &tai_s)) return;
    if (device_loses_pps(&device->head_faults, edge_ns)) return;
    pps_take(&device->pps, edge_ns, tai_s);
    int64_t tai_ns = tai_s * UTC_SECOND_NS;
    char text[UTC_TEXT_LEN];
    struct utc_time utc;
    utc_from_tai(&clock->table, tai_ns, &utc);
    utc_format(&utc, 0, text);
    device_push_event(&device->events, NATIVE_EV_PPS,
                      (uint64_t)(utc_posix_from_tai(&clock->table, tai_ns) / UTC_SECOND_NS), (uint64_t)edge_ns,
                      (uint64_t)(utc_gps_ns(tai_ns) / UTC_SECOND_NS), text);
}

void device_follow_ptp(struct device *device, uint64_t tick)
{
    const int64_t t_ns = (int64_t)tick * device->tick_ns;
    const enum head_state state = device->machine.state;
    ptp_run(&device->ptp, t_ns, t_ns + device->tick_ns, state != HEAD_OFF && state != HEAD_BOOT);
}

void device_tell_time(const struct device *device, int64_t t_ns, struct native_telemetry *t)
{
    const struct head_clock *clock = &device->clock;
    const struct ptp_status *ptp = ptp_at(&device->ptp, t_ns);
    if (clock->source != EPOCH_NONE) t->utc_ns = utc_posix_from_tai(&clock->table, head_clock_ns(clock, t_ns));
    if (ptp == NULL) return;
    t->ptp_port = ptp->port;
    t->ptp_servo = ptp->servo;
    t->ptp_offset_ns = ptp->offset_ns;
    t->ptp_delay_ns = ptp->delay_ns;
    t->ptp_grandmaster = ptp->grandmaster;
    t->ptp_class = ptp->clock_class;
    t->ptp_accuracy = ptp->clock_accuracy;
    t->ptp_flags = ptp->utc_valid ? NATIVE_PTP_UTC_VALID : 0;
}

void device_say_time(struct device *device, uint64_t tick)
{
    int64_t t_ns = (int64_t)tick * device->tick_ns;
    if (device->clock.source == EPOCH_NONE) return;
    device_push_event(&device->events, NATIVE_EV_TIME, 0, (uint64_t)t_ns, (uint64_t)device_gps_ns(device, t_ns), "");
}

void device_set_time_texts(struct device *device)
{
    struct command_device *cmd = &device->cmd;
    const struct head_clock *clock = &device->clock;
    const struct ptp_status *ptp = ptp_at(&device->ptp, cmd->t_ns);
    cmd->utc[0] = cmd->gps[0] = cmd->ptp[0] = '\0';
    if (ptp != NULL) ptp_text(ptp, cmd->ptp);
    if (clock->source == EPOCH_NONE) return;
    int64_t tai_ns = head_clock_ns(clock, cmd->t_ns);
    struct utc_time utc;
    utc_from_tai(&clock->table, tai_ns, &utc);
    utc_format(&utc, 9, cmd->utc);
    struct utc_gps gps = utc_gps_week(tai_ns);
    snprintf(cmd->gps, sizeof cmd->gps, "%lld,%lld.%09lld", (long long)gps.week, (long long)(gps.ns / UTC_SECOND_NS),
             (long long)(gps.ns % UTC_SECOND_NS));
}

int64_t device_utc_ns(struct device *device, int64_t t_ns)
{
    const struct head_clock *clock = &device->clock;
    if (clock->source == EPOCH_NONE) return INT64_MIN;
    pthread_mutex_lock(&device->lock); /* faults may change the clock */
    const int64_t utc_ns = utc_posix_from_tai(&clock->table, head_clock_ns(clock, t_ns));
    pthread_mutex_unlock(&device->lock);
    return utc_ns;
}

enum protocol_pps device_pps(struct device *device, int64_t t_ns, int *set)
{
    pthread_mutex_lock(&device->lock);
    const enum protocol_pps state = pps_at(&device->pps, t_ns, set);
    pthread_mutex_unlock(&device->lock);
    return state;
}

int64_t device_next_fix_ns(const struct device *device, int64_t t_ns)
{
    const struct gnss *gnss = &device->gnss;
    return gnss->on ? gnss_time_ns(gnss, gnss_count(gnss, t_ns)) : INT64_MAX;
}

int device_fix(struct device *device, int64_t t_ns, struct nmea_fix *fix)
{
    const uint64_t n = gnss_count(&device->gnss, t_ns + 1);
    if (n == 0) return 0;
    struct gnss_track track;
    const int64_t at_ns = gnss_time_ns(&device->gnss, n - 1);
    struct device_version *version;
    struct gnss gnss = device->gnss;
    struct head_clock clock;
    gnss.site = device_hold_site(device, &version); /* stations may move meanwhile */
    gnss.clock = &clock;
    pthread_mutex_lock(&device->lock);
    clock = device->clock; /* a copy: faults may change its table of leap seconds */
    uint32_t station = device->cmd.settings.station - 1;
    int moves = device_head_pose(device, at_ns, &track.at);
    if (moves) {
        device_head_pose(device, at_ns - GNSS_STEP_NS, &track.before);
        device_head_pose(device, at_ns + GNSS_STEP_NS, &track.after);
    }
    pthread_mutex_unlock(&device->lock);
    gnss_fix(&gnss, n - 1, station, moves ? &track : NULL, fix);
    device_give_back(version);
    return 1;
}
