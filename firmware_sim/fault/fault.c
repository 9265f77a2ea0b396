/* SPDX-License-Identifier: MIT */
#include "firmware_sim/fault/fault.h"

#include "core/rng.h"

const char *const fault_names[] = {
#define KIND(kind, name) name,
#include "firmware_sim/fault/kinds.h"
#undef KIND
    NULL,
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
