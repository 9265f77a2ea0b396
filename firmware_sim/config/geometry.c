/* SPDX-License-Identifier: MIT */
/* Geometries of a planar head: pairs of a line rate and the steps of a turn. The profile's step numbers count in
 * steps_per_turn. A coarser geometry divides them all by the same whole number, so its beams are some of the
 * profile's. */
#include "firmware_sim/config/check_head.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/table/given.h"
#include "firmware_sim/config/table/value.h"

#include <stdio.h>

void config_set_steps(struct config_profile *p, uint32_t steps)
{
    const struct config_emitter *c = &p->arrangement;
    const uint32_t by = c->steps_per_turn / steps;
    emitter_set_planar(&p->emitter, steps, c->first_step / by, c->last_step / by, c->front_step / by,
                       c->step_direction == TURN_CLOCKWISE ? 1 : -1);
}

static int divides_all(const struct config_emitter *c, uint32_t steps)
{
    const uint32_t by = c->steps_per_turn / steps;
    return c->steps_per_turn % steps == 0 && c->first_step % by == 0 && c->last_step % by == 0 &&
           c->front_step % by == 0;
}

static int stands_before(const struct config_emitter *c, uint32_t i)
{
    for (uint32_t k = 0; k < i; k++)
        if (c->geometry[k].lines_uhz == c->geometry[i].lines_uhz &&
            c->geometry[k].steps_per_turn == c->geometry[i].steps_per_turn)
            return 1;
    return 0;
}

static void check_one(struct cfg_reader *rd, const struct config_profile *p, uint32_t i)
{
    const struct config_geometry *g = &p->arrangement.geometry[i];
    if (!CFG_ITEM_SOUND(rd, i, "geometries[].lines_hz", "geometries[].steps_per_turn")) return;
    if (g->lines_uhz < p->lines_min_uhz || g->lines_uhz > p->lines_max_uhz)
        cfg_fail_item(rd, "geometries[].lines_hz", i,
                      "%.15g is outside of lines_min_hz and lines_max_hz; allowed %.15g to %.15g Hz",
                      from_micro(g->lines_uhz), from_micro(p->lines_min_uhz), from_micro(p->lines_max_uhz));
    else if (!divides_all(&p->arrangement, g->steps_per_turn))
        cfg_fail_item(
            rd, "geometries[].steps_per_turn", i,
            "%u; the head's steps_per_turn (%u) divided by this number must be a whole number that also divides "
            "first_step, last_step and front_step",
            g->steps_per_turn, p->arrangement.steps_per_turn);
    else if (stands_before(&p->arrangement, i))
        cfg_fail_item(rd, "geometries[].lines_hz", i, "this geometry is given twice; allowed once");
}

void cfg_check_geometries(struct cfg_reader *rd, struct config_profile *p)
{
    const struct config_emitter *c = &p->arrangement;
    if (c->n_geometries == 0 || !CFG_SOUND(rd, "lines_min_hz", "lines_max_hz")) return;
    for (uint32_t i = 0; i < c->n_geometries; i++)
        check_one(rd, p, i);
    if (!CFG_SOUND(rd, "geometries")) return;
    for (uint32_t i = 0; i < c->n_geometries; i++) {
        const int64_t prr_uhz = c->geometry[i].lines_uhz * c->geometry[i].steps_per_turn;
        if (i == 0) p->prr_min_uhz = p->prr_max_uhz = prr_uhz;
        if (prr_uhz < p->prr_min_uhz) p->prr_min_uhz = prr_uhz;
        if (prr_uhz > p->prr_max_uhz) p->prr_max_uhz = prr_uhz;
    }
    config_set_steps(p, c->geometry[0].steps_per_turn);
}

/* Writes "50 Hz at 0.5 deg, 25 Hz at 0.25 deg". */
static const char *list_of(const struct config_emitter *c, char *buf, size_t len)
{
    size_t used = 0;
    for (uint32_t i = 0; i < c->n_geometries && used < len; i++)
        used += (size_t)snprintf(buf + used, len - used, "%s%.15g Hz at %.15g deg", i > 0 ? ", " : "",
                                 from_micro(c->geometry[i].lines_uhz),
                                 from_micro(head_step_udeg(c->geometry[i].steps_per_turn)));
    return buf;
}

/* Takes the first geometry that has the given line rate and step. */
void cfg_choose_geometry(struct cfg_reader *rd, struct config *cfg)
{
    struct config_profile *p = &cfg->profile;
    struct config_head *h = &cfg->head;
    const int rate = cfg_is_given(rd, "head.lines_hz"), step = cfg_is_given(rd, "head.step_deg");
    char list[HEAD_MAX_RATES * 64];
    if (!CFG_SOUND(rd, "head.lines_hz", "head.step_deg")) return;
    for (uint32_t i = 0; i < p->arrangement.n_geometries; i++) {
        const struct config_geometry *g = &p->arrangement.geometry[i];
        if ((rate && g->lines_uhz != h->settings.lines_uhz) ||
            (step && head_step_udeg(g->steps_per_turn) != h->step_udeg))
            continue;
        config_set_steps(p, g->steps_per_turn);
        h->settings.lines_uhz = g->lines_uhz;
        if (!cfg_is_given(rd, "head.prr_hz")) h->settings.prr_uhz = g->lines_uhz * g->steps_per_turn;
        return;
    }
    list_of(&p->arrangement, list, sizeof list);
    if (rate && step)
        cfg_fail_key(rd, "head.step_deg", "%.15g, with a lines_hz of %.15g; allowed with head profile %s: %s",
                     from_micro(h->step_udeg), from_micro(h->settings.lines_uhz), p->name, list);
    else
        cfg_fail_key(rd, step ? "head.step_deg" : "head.lines_hz", "%.15g; allowed with head profile %s: %s",
                     from_micro(step ? h->step_udeg : h->settings.lines_uhz), p->name, list);
}
