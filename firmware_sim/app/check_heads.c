/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/check_heads.h"
#include "firmware_sim/config/config.h"

static void print_stations(const struct config *cfg, FILE *out)
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < cfg->n_stations; i++)
        n += config_serves(cfg, i) != 0;
    fprintf(out, "station%s ", n > 1 ? "s" : "");
    for (uint32_t i = 0, k = 0; i < cfg->n_stations; i++)
        if (config_serves(cfg, i)) fprintf(out, "%s%u", k++ > 0 ? ", " : "", i + 1);
    fputs(": ", out);
}

/* Where there are several scanners, the line begins with the stations that this one scans from. */
static void print_head(const struct config *cfg, FILE *out)
{
    const struct head_settings *s = &cfg->head.settings;
    char emitter[160];
    fputs("head      ", out);
    if (!config_is_alone(cfg)) print_stations(cfg, out);
    fprintf(out, "%s %s (%s), %g Hz pulses, %g lines/s, pan %g deg/s\n", cfg->profile.maker, cfg->profile.model,
            cfg->profile.name, (double)s->prr_uhz * 1e-6, (double)s->lines_uhz * 1e-6, (double)s->pan_udeg_s * 1e-6);
    if (config_limits_range(cfg))
        fprintf(out, "range     %g to %g m only (head.range_min_m, range_max_m); the head profile has %g to %g\n",
                cfg->head.range_min_m, cfg->head.range_max_m, cfg->head.profile_min_m, cfg->head.profile_max_m);
    emitter_describe(&cfg->profile.emitter, emitter, sizeof emitter);
    if (emitter[0] != '\0') fprintf(out, "emitter   %s\n", emitter);
}

void check_print_heads(const struct sites *sites, FILE *out)
{
    print_head(sites->first->cfg, out);
    for (uint32_t i = 0; i < sites->n; i++) {
        const struct site *site = sites->other[i].site;
        print_head(site->cfg, out);
        if (site->scale_m != sites->first->scale_m)
            fprintf(out, "output    of this head %g m per count\n", site->scale_m);
    }
}
