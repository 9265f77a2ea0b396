/* SPDX-License-Identifier: MIT */
#include "firmware_sim/fault/fault.h"

#include "core/rng.h"

const char *const fault_names[] = {
    [FAULT_DROP] = "drop",
    [FAULT_DUPLICATE] = "duplicate",
    [FAULT_REORDER] = "reorder",
    [FAULT_DELAY] = "delay",
    [FAULT_JITTER] = "jitter",
    [FAULT_TRUNCATE] = "truncate",
    [FAULT_FLIP] = "flip",
    [FAULT_STALL] = "stall",
    [FAULT_SPLIT] = "split",
    [FAULT_MERGE] = "merge",
    [FAULT_GARBAGE] = "garbage",
    [FAULT_NO_REPLY] = "no_reply",
    [FAULT_LATE_REPLY] = "late_reply",
    [FAULT_WRONG_REPLY] = "wrong_reply",
    [FAULT_ECHO] = "echo",
    [FAULT_DISCONNECT] = "disconnect",
    [FAULT_UNPLUG] = "unplug",
    [FAULT_CABLE] = "cable",
    [FAULT_USB_RESET] = "usb_reset",
    [FAULT_ENDPOINT_STALL] = "endpoint_stall",
    [FAULT_SHORT_PACKETS] = "short_packets",
    [FAULT_REFUSE] = "refuse",
    [FAULT_SLOW_ENUMERATION] = "slow_enumeration",
    [FAULT_DESCRIPTOR_LENGTH] = "descriptor_length",
    [FAULT_SLOW_BOOT] = "slow_boot",
    [FAULT_POWER_CYCLE] = "power_cycle",
    [FAULT_SELF_TEST] = "self_test",
    [FAULT_MIRROR_SLOW] = "mirror_slow",
    [FAULT_MIRROR_STUCK] = "mirror_stuck",
    [FAULT_MIRROR_WOBBLE] = "mirror_wobble",
    [FAULT_PAN_SLIP] = "pan_slip",
    [FAULT_LASER_OFF] = "laser_off",
    [FAULT_WINDOW_SOILED] = "window_soiled",
    [FAULT_CLOCK_JUMP] = "clock_jump",
    [FAULT_CLOCK_DRIFT] = "clock_drift",
    [FAULT_CLOCK_STOP] = "clock_stop",
    [FAULT_PPS_LOST] = "pps_lost",
    [FAULT_PPS_JITTER] = "pps_jitter",
    [FAULT_NMEA_LOST] = "nmea_lost",
    [FAULT_NMEA_LATE] = "nmea_late",
    [FAULT_NMEA_VOID] = "nmea_void",
    [FAULT_NMEA_CHECKSUM] = "nmea_checksum",
    [FAULT_PTP_LOST] = "ptp_lost",
    [FAULT_PTP_NO_SYNC] = "ptp_no_sync",
    [FAULT_PTP_FAULTY] = "ptp_faulty",
    [FAULT_PTP_GRANDMASTER] = "ptp_grandmaster",
    [FAULT_PTP_STEP] = "ptp_step",
    [FAULT_PTP_ASYMMETRY] = "ptp_asymmetry",
    [FAULT_PTP_JITTER] = "ptp_jitter",
    [FAULT_LEAP_SECOND] = "leap_second",
    [FAULT_COUNTERS_HIGH] = "counters_high",
    [FAULT_NTP_SILENT] = "ntp_silent",
    [FAULT_NTP_KISS] = "ntp_kiss",
    [FAULT_NTP_UNSYNC] = "ntp_unsync",
    [FAULT_NTP_STEP] = "ntp_step",
    [FAULT_N_KINDS] = NULL,
};

enum fault_place fault_place_of(enum fault_kind kind)
{
    if (kind >= FAULT_SLOW_BOOT) return FAULT_AT_MOMENT;
    if (kind >= FAULT_REFUSE) return FAULT_AT_CONNECTION;
    if (kind >= FAULT_NO_REPLY && kind <= FAULT_ECHO) return FAULT_AT_REPLY;
    return FAULT_AT_FRAME;
}

int fault_is_act(enum fault_kind kind)
{
    return kind >= FAULT_DISCONNECT && kind <= FAULT_SHORT_PACKETS;
}

enum fault_kind fault_act_of(enum fault_kind kind, uint32_t acts)
{
    return kind == FAULT_CABLE && (acts >> (FAULT_CABLE - FAULT_DISCONNECT) & 1U) == 0 ? FAULT_UNPLUG : kind;
}

uint32_t fault_n(const struct fault *fault)
{
    if (fault->n != 0) return fault->n;
    switch (fault->kind) {
    case FAULT_TRUNCATE:
        return 0;
    case FAULT_SPLIT:
    case FAULT_MERGE:
        return 2;
    case FAULT_GARBAGE:
        return 16;
    default:
        return 1;
    }
}

static int is_numbered(const struct fault *f, uint64_t number)
{
    if (f->at != 0) return number == f->at;
    return number >= f->from && (f->until == 0 || number <= f->until) && (number - f->from) % f->every == 0;
}

static int is_in_time(const struct fault *f, int64_t t_ns)
{
    const double t_s = 1e-9 * (double)t_ns;
    return t_s >= f->from_s && (f->until_s <= 0.0 || t_s < f->until_s);
}

static int has_its_pulses(const struct fault *f, const struct fault_spot *spot)
{
    if (f->from_pulse == 0 && f->until_pulse == UINT64_MAX) return 1;
    return spot->has_pulses && spot->n_pulses != 0 && spot->pulse0 <= f->until_pulse &&
           spot->pulse0 + spot->n_pulses > f->from_pulse;
}

uint64_t fault_random(const struct fault *fault, uint32_t index, uint32_t link, uint64_t number, uint32_t draw)
{
    const uint64_t key = rng_key(fault->seed, RNG_FAULT) ^ rng_mix((uint64_t)index << 32 | link);
    return rng_u64(key, rng_echo(number, draw));
}

int fault_strikes(const struct fault *fault, uint32_t index, uint32_t link, const struct fault_spot *spot)
{
    if (fault->link != 0 && link != fault->link) return 0;
    if (spot->number != 0 && !is_numbered(fault, spot->number)) return 0;
    if (!is_in_time(fault, spot->t_ns) || !has_its_pulses(fault, spot)) return 0;
    if (fault->probability >= 1.0) return 1;
    return 0x1p-64 * (double)fault_random(fault, index, link, spot->number, 0) < fault->probability;
}
