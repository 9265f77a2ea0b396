/* SPDX-License-Identifier: MIT */
/* Tripods of stations: checks that leg_m is given and fits the legs, and that the platform stands. */
#include "firmware_sim/config/check_places.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/table/given.h"
#include "firmware_sim/config/table/reader.h"
#include "firmware_sim/config/table/row.h"

static void check_tripod(struct cfg_reader *rd, const struct config *cfg, struct config_tripod *t, uint32_t i)
{
    for (size_t k = 0; k < rd->table.n; k++)
        t->given |= cfg_is_in(rd->table.keys[k].path, "stations[].tripod") && rd->line[k][i] != 0;
    if (!t->given || !CFG_ITEM_SOUND(rd, i, "stations[].tripod")) return;
    if (!cfg_is_item_given(rd, "stations[].tripod.leg_m", i))
        cfg_fail_missing(rd, "stations[].tripod.leg_m", i);
    else if (t->legs && t->leg_diameter_m >= 0.5 * t->leg_m)
        cfg_fail_item(rd, "stations[].tripod.leg_diameter_m", i,
                      "%.10g m, but a leg is %.10g m long; allowed is less than half of that, %.10g m",
                      t->leg_diameter_m, t->leg_m, 0.5 * t->leg_m);
    if (config_head_moves(&cfg->platform) && CFG_SOUND(rd, "platform.kind"))
        cfg_fail_item(rd, "stations[].tripod", i,
                      "a tripod must stand still, but platform.kind is %s; allowed with static and stops",
                      cfg_word(rd, "platform.kind", (int)cfg->platform.kind));
}

void cfg_check_tripods(struct cfg_reader *rd, struct config *cfg)
{
    for (uint32_t i = 0; i < cfg->n_stations; i++)
        check_tripod(rd, cfg, &cfg->station[i].tripod, i);
}
