/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/cola_watch.h"

#include <math.h>
#include <string.h>

#include "drivers/protocol/cola_units.h"

void cola_watch_select(struct cola_watch *watch, const struct cola_fields *fields, const uint32_t *numbers,
                       const uint8_t *outputs, uint32_t n)
{
    for (uint32_t i = 0; i < watch->n; i++)
        watch->other |= watch->slot[i].result != COLA_RESULT_INVALID;
    for (uint32_t k = 0; k < COLA_WATCH_OUTPUTS; k++)
        watch->other |= watch->output[k].active;
    watch->n = n;
    watch->on = watch->other;
    for (uint32_t i = 0; i < n; i++) {
        struct cola_slot *slot = &watch->slot[i];
        memset(slot, 0, sizeof *slot);
        slot->field = numbers[i];
        slot->output = outputs[i];
        watch->on |=
            fields->field[numbers[i]].shape.n != 0 || fields->field[numbers[i]].shape.kind == COLA_SHAPE_SECTOR;
    }
}

/* ---- one beam */

/* Chooses the echoes of a beam that count. Returns how many there are, from *first on. */
static uint32_t choose(const struct planar_turn *turn, uint32_t beam, enum cola_echoes echoes, uint32_t *first)
{
    const uint32_t n = turn->n[beam]; /* never PLANAR_UNSEEN: in a whole turn every beam has its pulse */
    *first = echoes == COLA_ECHOES_LAST && n != 0 ? n - 1 : 0;
    return echoes == COLA_ECHOES_ALL || n == 0 ? n : 1;
}

/* Computes the points of the echoes that count. */
static uint32_t measure(const struct planar_head *head, const struct planar_turn *turn, uint32_t beam,
                        enum cola_echoes echoes, struct cola_measured out[PLANAR_ECHOES])
{
    uint32_t first, n_out = 0;
    const uint32_t n = choose(turn, beam, echoes, &first);
    const int32_t step = (int32_t)cola_beam_quarters(head, beam), steps = 4 * (int32_t)head->steps;
    for (uint32_t k = first; k < first + n; k++) {
        const double range_m = turn->echo[beam][k].range * head->m_per_count;
        if (range_m * 1e6 > COLA_SHAPE_REACH_UM || turn->echo[beam][k].range == 0) continue;
        /* A range equal to the minimum counts. Rounded for the stream, that range may be half a count lower. */
        if (range_m < head->range_min_m - 0.5 * head->m_per_count) continue;
        out[n_out++] = cola_measured_at(step, steps, (int32_t)lround(range_m * 1e6));
    }
    return n_out;
}

/* The range of the nearest object in a shape; 0: there is none. */
static int32_t nearest_in(const struct cola_shape *shape, const struct cola_measured *seen, uint32_t n)
{
    for (uint32_t k = 0; k < n; k++) /* in order of range */
        if (cola_shape_has(shape, &seen[k])) return seen[k].range_um;
    return 0;
}

/* ---- one field */

static void end_run(struct cola_slot *slot, const struct cola_field *field, uint32_t steps)
{
    const double width_um = slot->run * (COLA_TURN_RAD / steps) * slot->run_um;
    if (slot->run != 0 && width_um >= field->blanking_um) slot->is_hit = 1;
    slot->run = 0;
    slot->run_um = INT32_MAX;
}

static void see(struct cola_slot *slot, const struct cola_field *field, uint32_t steps, uint32_t beam, int32_t range_um)
{
    uint16_t *in_row = &slot->in_row[beam];
    *in_row = range_um == 0 ? 0 : *in_row < UINT16_MAX ? (uint16_t)(*in_row + 1) : UINT16_MAX;
    if (*in_row < slot->need) {
        end_run(slot, field, steps);
        return;
    }
    slot->run++;
    if (range_um < slot->run_um) slot->run_um = range_um;
}

/* Returns whether the result changed. */
static int conclude(struct cola_slot *slot, const struct cola_field *field, const struct planar_head *head,
                    int64_t t_ns)
{
    end_run(slot, field, head->steps);
    const uint8_t result = field->shape.kind == COLA_SHAPE_NONE ? COLA_RESULT_INVALID
                           : slot->is_hit                       ? COLA_RESULT_INFRINGED
                                                                : COLA_RESULT_FREE;
    const int changed = result != slot->result;
    if (changed) slot->changed_ns = t_ns;
    slot->result = result;
    return changed;
}

/* Returns the number of scans nearest to the response time, at least 1. */
static uint32_t scans_of(uint32_t response_ms, const struct planar_head *head)
{
    const uint64_t n = ((uint64_t)response_ms * head->lines_uhz + UINT64_C(500000000)) / UINT64_C(1000000000);
    return n < 1 ? 1 : n < UINT16_MAX ? (uint32_t)n : UINT16_MAX;
}

static void begin(struct cola_watch *watch, const struct cola_fields *fields, const struct planar_head *head)
{
    const int other = watch->steps != head->steps || watch->n_beams != head->n;
    watch->steps = head->steps;
    watch->n_beams = head->n;
    for (uint32_t i = 0; i < watch->n; i++) {
        struct cola_slot *slot = &watch->slot[i];
        slot->need = scans_of(fields->field[slot->field].response_ms, head);
        slot->is_hit = 0;
        slot->run = 0;
        slot->run_um = INT32_MAX;
        if (other) memset(slot->in_row, 0, sizeof slot->in_row);
    }
}

/* An output is active while one of its fields is infringed. */
static unsigned switch_outputs(struct cola_watch *watch)
{
    unsigned news = 0;
    for (uint32_t k = 0; k < COLA_WATCH_OUTPUTS; k++) {
        uint8_t active = 0;
        for (uint32_t i = 0; i < watch->n; i++)
            active |= watch->slot[i].output == k + 1 && watch->slot[i].result == COLA_RESULT_INFRINGED;
        if (active == watch->output[k].active) continue;
        watch->output[k].active = active;
        watch->output[k].count += active;
        news = COLA_NEW_OUTPUT;
    }
    return news;
}

unsigned cola_watch_scan(struct cola_watch *watch, const struct cola_fields *fields, const struct planar_head *head,
                         const struct planar_turn *turn, enum cola_echoes echoes)
{
    unsigned news = watch->other ? COLA_NEW_RESULT : 0;
    watch->other = 0;
    begin(watch, fields, head);
    for (uint32_t beam = 0; beam < head->n; beam++) {
        struct cola_measured seen[PLANAR_ECHOES];
        const uint32_t n = measure(head, turn, beam, echoes, seen);
        for (uint32_t i = 0; i < watch->n; i++) {
            struct cola_slot *slot = &watch->slot[i];
            const struct cola_field *field = &fields->field[slot->field];
            see(slot, field, head->steps, beam, nearest_in(&field->shape, seen, n));
        }
    }
    for (uint32_t i = 0; i < watch->n; i++)
        if (conclude(&watch->slot[i], &fields->field[watch->slot[i].field], head, turn->t0_ns)) news = COLA_NEW_RESULT;
    return news | switch_outputs(watch);
}
