/* SPDX-License-Identifier: MIT */
/* Injected faults that change what is measured: checks that the head has what they act on. */
#include "drivers/protocol/protocol.h"
#include "firmware_sim/config/check_faults.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/table/given.h"
#include "firmware_sim/config/table/value.h"

static void check_mirror(struct cfg_reader *rd, const struct config *cfg, const struct fault *f, uint32_t i)
{
    const enum emitter_kind kind = cfg->profile.emitter.kind;
    const char *name = fault_names[f->kind], *profile = cfg->profile.name;
    const int is_slow = f->kind == FAULT_MIRROR_SLOW;
    if (kind == EMITTER_SPHERE || kind == EMITTER_DIRECTIONS)
        cfg_fail_item(rd, "faults[].kind", i, "%s, but head profile %s (%s) has no mirror; allowed with line, %sbeams",
                      name, profile, emitter_names[kind], is_slow ? "planar, " : "");
    else if (kind == EMITTER_PLANAR && !is_slow)
        cfg_fail_item(rd, "faults[].kind", i,
                      "%s, but head profile %s (planar) fires at steps of its mirror; allowed with line, beams, or "
                      "mirror_slow",
                      name, profile);
    else if (kind == EMITTER_PLANAR && cfg->platform.kind == PLATFORM_LIVE)
        cfg_fail_item(rd, "faults[].kind", i,
                      "%s, but head profile %s (planar) is on a live platform; allowed with platform.kind static, "
                      "trajectory or stops",
                      name, profile);
}

static void check_factor(struct cfg_reader *rd, const struct config *cfg, const struct fault *f, uint32_t i)
{
    const double lines_hz = from_micro(cfg->head.settings.lines_uhz);
    const double most_hz = from_micro(cfg->profile.lines_max_uhz);
    if (f->factor > 1.0 && f->factor * lines_hz > most_hz)
        cfg_fail_item(rd, "faults[].factor", i,
                      "%.10g times %.10g lines per second are more than head profile %s can have; allowed %s %.10g",
                      f->factor, lines_hz, cfg->profile.name, most_hz > lines_hz ? "up to" : "below",
                      most_hz / lines_hz);
}

/* A soiled window shows only in amplitudes, in noise that grows as the signal fades, or in LCMstate of cola. Windows
 * are checked for the scanner of head.station alone: that scanner has the links, and one of them may speak cola. */
static void check_window(struct cfg_reader *rd, const struct config *cfg, uint32_t i)
{
    const int is_noisy = cfg->noise.range == RANGE_NOISE_ON && cfg->profile.range_sigma_m > 0.0;
    if (!cfg->signal.on && !is_noisy && !cfg->links_are_not_here && !config_speaks(cfg, PROTOCOL_COLA) &&
        CFG_SOUND(rd, "links"))
        cfg_fail_item(
            rd, "faults[].kind", i,
            "window_soiled would have no effect: no signal is modelled, ranges have no noise, and no link speaks cola; "
            "allowed with signal.model: on, or noise.range: on and noise.sigma_m above 0, or links[].protocol: cola");
}

void cfg_check_fault_beams(struct cfg_reader *rd, const struct config *cfg, const struct fault_list *list)
{
    if (!CFG_SOUND(rd, "head", "noise", "signal", "platform") || cfg->profile.lines_max_uhz <= 0) return;
    for (uint32_t i = 0; i < list->n; i++) {
        const struct fault *f = &list->fault[i];
        if (!CFG_ITEM_SOUND(rd, i, "faults[].kind", "faults[].factor")) continue;
        if (f->kind >= FAULT_MIRROR_SLOW && f->kind <= FAULT_MIRROR_WOBBLE) check_mirror(rd, cfg, f, i);
        if (f->kind == FAULT_MIRROR_SLOW) check_factor(rd, cfg, f, i);
        if (f->kind == FAULT_WINDOW_SOILED) check_window(rd, cfg, i);
    }
}
