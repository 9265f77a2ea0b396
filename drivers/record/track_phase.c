/* SPDX-License-Identifier: MIT */
#include "drivers/record/track_phase.h"

#include "core/wide.h"

static void set_rates(struct track_phase *phase, uint64_t prr_uhz, uint64_t lines_uhz)
{
    const uint64_t common = (uint64_t)gcd(prr_uhz, lines_uhz);
    const int known = prr_uhz > 0 && lines_uhz > 0;
    phase->num = known ? lines_uhz / common : 0;
    phase->den = known ? prr_uhz / common : 0;
}

void track_phase_start(struct track_phase *phase, uint64_t prr_uhz, uint64_t lines_uhz)
{
    *phase = (struct track_phase){0};
    set_rates(phase, prr_uhz, lines_uhz);
}

void track_phase_restart(struct track_phase *phase)
{
    phase->pulse = phase->r = 0;
    phase->line = 0;
    phase->changed = 0;
}

/* Returns the sweeps since the phase's line began, in parts of den. */
static u128 parts_at(const struct track_phase *phase, uint64_t pulse)
{
    return phase->r + (u128)(pulse - phase->pulse) * phase->num;
}

void track_phase_change(struct track_phase *phase, uint64_t pulse, uint64_t prr_uhz, uint64_t lines_uhz)
{
    const struct track_phase was = *phase;
    if (was.den == 0 || pulse < was.pulse) {
        track_phase_start(phase, prr_uhz, lines_uhz); /* the lines that follow correct it */
        return;
    }
    const u128 parts = parts_at(&was, pulse);
    phase->pulse = pulse;
    phase->line = was.line + (uint32_t)(parts / was.den);
    set_rates(phase, prr_uhz, lines_uhz);
    phase->r = (uint64_t)(parts % was.den * phase->den / was.den); /* cut as in the head */
    phase->changed = 1;
}

void track_phase_line(struct track_phase *phase, uint32_t line, uint64_t pulse0)
{
    if (phase->den == 0) return;
    if (line > phase->line && pulse0 >= phase->pulse) {
        const u128 begin = (u128)(line - phase->line) * phase->den, parts = parts_at(phase, pulse0);
        if (parts >= begin && parts - begin < phase->num) return;
    }
    phase->line = line;
    phase->pulse = pulse0;
    phase->changed = 0;
    phase->r = phase->num / 2; /* a line begins with the first pulse that is not before its angle 0 */
}

int track_phase_row(const struct track_phase *phase, uint32_t line, uint64_t pulse, uint64_t *row)
{
    if (phase->den == 0 || !phase->changed || line != phase->line || pulse < phase->pulse) return 0;
    *row = phase->r / phase->num + (pulse - phase->pulse);
    return 1;
}
