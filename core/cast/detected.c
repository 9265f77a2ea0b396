/* A chunk of pulses with everything between a hit and a point that a configuration asks for. */
#include <math.h>
#include <string.h>

#include "core/cast/caster_private.h"
#include "core/rng.h"
#include "core/surface.h"

static const double AS_IT_IS[9] = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};

static void transpose(const double m[9], double t[9])
{
    for (int i = 0; i < 9; i++)
        t[i] = m[i % 3 * 3 + i / 3];
}

/* Where the beams go and begin, as the mechanics are; c->mirror_turn and pan_turn become what the encoders say. */
static void aim_beams(struct caster *c, const struct cast_setup *s, const struct schedule_run *run,
                      const uint32_t *dt_ns, uint32_t at, uint32_t n, struct origins *from)
{
    const struct instrument *k = s->detect->instrument;
    struct moving_rays *m = &c->moving;
    int moves = s->n_knots != 0, offset = k != NULL && instrument_has_offset(k);
    double back[9];
    kernel_angles(run, at, n, c->mirror_turn, c->pan_turn);
    *from = (struct origins){.at_m = {s->station_m[0], s->station_m[1], s->station_m[2]}};
    if (k == NULL && !moves) {
        kernel_directions(c->mirror_turn, c->pan_turn, s->rotation, n, c->dx, c->dy, c->dz);
        return;
    }
    const struct instrument_beams beams = {m->sx, m->sy, m->sz, offset ? m->rx : NULL, m->ry, m->rz};
    if (k != NULL) {
        instrument_aim(k, run->pulse0 + at, n, c->mirror_turn, c->pan_turn, &beams);
        instrument_read(k, n, c->mirror_turn, c->pan_turn);
    } else {
        kernel_directions(c->mirror_turn, c->pan_turn, AS_IT_IS, n, m->sx, m->sy, m->sz);
    }
    if (moves) {
        caster_move(c, s, run->t0_ns, dt_ns, n, offset);
    } else {
        transpose(s->rotation, back);
        kernel_turn_back(m->sx, m->sy, m->sz, back, n, c->dx, c->dy, c->dz);
        if (!offset) return;
        kernel_turn_back(m->rx, m->ry, m->rz, back, n, c->ex, c->ey, c->ez);
    }
    for (uint32_t i = 0; i < n && offset; i++) {
        m->px[i] = (moves ? m->px[i] : s->station_m[0]) + c->ex[i];
        m->py[i] = (moves ? m->py[i] : s->station_m[1]) + c->ey[i];
        m->pz[i] = (moves ? m->pz[i] : s->station_m[2]) + c->ez[i];
    }
    from->px = m->px;
    from->py = m->py;
    from->pz = m->pz;
}

/* One hit for each pulse. */
static void list_hits(struct caster *c, uint32_t n)
{
    struct echo_list *l = &c->list;
    l->n = n;
    memcpy(l->range_m, c->range_m, n * sizeof *l->range_m);
    memcpy(l->cosine, c->cosine, n * sizeof *l->cosine);
    memcpy(l->label, c->label, n * sizeof *l->label);
    memset(l->ghost, 0, n * sizeof *l->ghost);
    for (uint32_t i = 0; i < n; i++) {
        l->pulse[i] = i;
        l->energy[i] = 1.0;
    }
}

static void make_keys(struct echo_list *l, uint64_t pulse0)
{
    uint32_t number = 0;
    for (uint32_t i = 0; i < l->n; i++) {
        number = i > 0 && l->pulse[i] == l->pulse[i - 1] ? number + 1 : 0;
        l->key[i] = rng_echo(pulse0 + l->pulse[i], number);
    }
}

static uint32_t count_echoes(const struct echo_list *l)
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < l->n; i++)
        n += l->range_m[i] == l->range_m[i];
    return n;
}

/* A bare pane or mirror sends nothing back: no echo, whether there is a signal model or not. */
static void leave_out_bare(const struct surface_table *table, struct echo_list *l)
{
    for (uint32_t i = 0; i < l->n; i++) {
        uint32_t label = surface_of_label(l->label[i]);
        const struct surface *surface = &table->surface[label < table->n ? label : table->n];
        if (l->rho[i] == 0.0 && surface->glass + surface->mirror > 0.0) l->range_m[i] = (double)NAN;
    }
}

/* What comes back within the range resolution after the return before is one echo with it: at the mean of the ranges,
 * weighted by what came back, with the surface that sent most. The others of its returns are left out of the list. */
static void merge_returns(struct echo_list *l, double separation_m)
{
    uint32_t to = 0;
    double last_m = 0.0, most = 0.0; /* of the echo at hand: its last return, its strongest */
    for (uint32_t i = 0; i < l->n; i++) {
        uint32_t e = to - 1;
        int same = to > 0 && l->pulse[e] == l->pulse[i] && l->rho[e] > 0.0 && l->rho[i] > 0.0 &&
                   l->range_m[i] - last_m <= separation_m; /* not-a-number: no */
        last_m = l->range_m[i];
        if (same) {
            double sum = l->rho[e] + l->rho[i];
            l->range_m[e] += (l->range_m[i] - l->range_m[e]) * l->rho[i] / sum;
            if (l->rho[i] > most) {
                l->label[e] = l->label[i];
                l->ghost[e] = l->ghost[i];
            }
            most = fmax(most, l->rho[i]);
            l->rho[e] = sum;
            continue;
        }
        most = l->rho[i];
        l->pulse[to] = l->pulse[i];
        l->range_m[to] = l->range_m[i];
        l->label[to] = l->label[i];
        l->ghost[to] = l->ghost[i];
        l->rho[to] = l->rho[i];
        to++;
    }
    l->n = to;
}

/* How much comes back of each, and what of it can't be told apart. */
static void weigh_returns(const struct cast_detect *d, struct echo_list *l)
{
    surface_return(d->surfaces, l->n, l->label, l->cosine, l->rho);
    for (uint32_t i = 0; i < l->n; i++)
        l->rho[i] *= l->energy[i];
    if (d->depth == 0) return;
    leave_out_bare(d->surfaces, l);
    if (d->separation_m > 0.0) merge_returns(l, d->separation_m);
}

/* Ranges of what is not detected become NaN. */
static void find_echoes(struct caster *c, const struct cast_setup *s, const struct schedule_run *run)
{
    const struct cast_detect *d = s->detect;
    struct echo_list *l = &c->list;
    const struct detect_echoes echoes = {.n = l->n,
                                         .key = l->key,
                                         .range_m = l->range_m,
                                         .rho = l->rho,
                                         .amplitude = l->amplitude,
                                         .refl_cdb = l->refl_cdb};
    uint32_t before = count_echoes(l);
    if (d->signal != NULL)
        detect_by_signal(d->signal, &echoes);
    else
        for (uint32_t i = 0; i < l->n; i++)
            l->refl_cdb[i] = LINE_REFL_NONE;
    if (d->ambiguity != DETECT_AMBIGUITY_NONE)
        detect_zones(d->ambiguity, 1e-9 * ((double)run->ns_quot + (double)run->ns_rem / (double)run->ns_den), d->zones,
                     s->range_min_m, l->n, l->range_m);
    c->counters.faint += before - count_echoes(l);
}

static void add_noise(struct caster *c, const struct cast_setup *s)
{
    const struct cast_detect *d = s->detect;
    struct echo_list *l = &c->list;
    const struct detect_echoes echoes = {.n = l->n, .key = l->key, .range_m = l->range_m, .amplitude = l->amplitude};
    if (d->noise_by_signal)
        detect_range_noise(d->signal, &echoes);
    else if (s->noise_on)
        detect_fixed_noise(s->range_sigma_m, 1e-6 * s->range_sigma_ppm, s->noise_key, l->n, l->key, l->range_m);
    if (d->instrument != NULL) instrument_range(d->instrument, l->n, l->range_m);
}

/* Of each pulse only its echoes stay, numbered, or one entry that says that there are none. Returns the number of
 * echoes. */
static uint32_t number_echoes(struct caster *c, const struct cast_detect *d)
{
    struct echo_list *l = &c->list;
    uint32_t total = 0, out = 0;
    for (uint32_t i = 0, end; i < l->n; i = end) {
        uint32_t kept = 0, first = out;
        for (end = i; end < l->n && l->pulse[end] == l->pulse[i]; end++) {
            if (isnan(l->range_m[end])) continue;
            if (kept == d->max_echoes) {
                c->counters.crowded++;
                continue;
            }
            uint32_t to = first + kept++;
            l->range_m[to] = l->range_m[end];
            l->label[to] = l->label[end] + (l->ghost[end] ? d->ghost_label : 0);
            l->refl_cdb[to] = l->refl_cdb[end];
            l->key[to] = l->key[end];
        }
        uint32_t pulse = l->pulse[i];
        if (kept == 0) {
            l->range_m[first] = (double)NAN;
            l->label[first] = LINE_LABEL_NONE;
            l->refl_cdb[first] = LINE_REFL_NONE;
        }
        out = first + (kept > 0 ? kept : 1);
        for (uint32_t k = first; k < out; k++) {
            l->pulse[k] = pulse;
            l->echo[k] = (uint8_t)(kept > 0 ? (k - first + 1) | kept << 4 : 0);
        }
        total += kept;
    }
    l->n = out;
    return total;
}

/* Entries out .. of the block, but for their three numbers. */
static void write_entries(struct caster *c, const uint32_t *dt_ns, struct line_block *block, uint32_t out)
{
    struct echo_list *l = &c->list;
    for (uint32_t i = 0; i < l->n; i++) {
        uint32_t pulse = l->pulse[i];
        l->mirror_turn[i] = c->mirror_turn[pulse];
        l->pan_turn[i] = c->pan_turn[pulse];
        l->dt_ns[i] = dt_ns[pulse];
    }
    for (uint32_t i = 0; i < l->n; i++)
        block->label[out + i] = (uint16_t)l->label[i];
    memcpy(block->dt_ns + out, l->dt_ns, l->n * sizeof *l->dt_ns);
    memcpy(block->refl_cdb + out, l->refl_cdb, l->n * sizeof *l->refl_cdb);
    memcpy(block->echo + out, l->echo, l->n * sizeof *l->echo);
}

/* Positions of entries, from what the encoders said. Returns how many echoes did not fit. */
static uint32_t write_positions(struct caster *c, const struct cast_setup *s, const struct schedule_run *run,
                                struct line_block *block, uint32_t out)
{
    struct echo_list *l = &c->list;
    struct moving_rays *m = &c->moving;
    uint32_t unfit = 0;
    double to_crs[9];
    int linear = s->n_knots == 0 && caster_reading_rotation(s, to_crs);
    for (uint32_t at = 0; at < l->n; at += CHUNK) {
        uint32_t n = l->n - at < CHUNK ? l->n - at : CHUNK;
        if (s->n_knots != 0) {
            kernel_directions_read(s, l->mirror_turn + at, l->pan_turn + at, AS_IT_IS, AS_IT_IS, n, m->sx, m->sy, m->sz,
                                   m->rx, m->ry, m->rz);
            caster_move(c, s, run->t0_ns, l->dt_ns + at, n, 1);
        } else {
            kernel_directions_read(s, l->mirror_turn + at, l->pan_turn + at, s->rotation, to_crs, n, c->dx, c->dy,
                                   c->dz, c->ex, c->ey, c->ez);
        }
        unfit += caster_positions(c, s, linear, l->range_m + at, block, out + at, n);
    }
    return unfit;
}

/* Some echoes have been taken back: the others of their pulses are numbered again. Returns how many entries are left.
 */
static uint32_t number_again(const struct echo_list *l, struct line_block *block, uint32_t out)
{
    uint32_t to = out;
    for (uint32_t i = 0, end; i < l->n; i = end) {
        uint32_t kept = 0, first = to;
        for (end = i; end < l->n && l->pulse[end] == l->pulse[i]; end++) {
            int last = end + 1 == l->n || l->pulse[end + 1] != l->pulse[i];
            if (block->echo[out + end] == 0 && !(last && kept == 0)) continue;
            kept += block->echo[out + end] != 0;
            block->a[to] = block->a[out + end];
            block->b[to] = block->b[out + end];
            block->c[to] = block->c[out + end];
            block->label[to] = block->label[out + end];
            block->refl_cdb[to] = block->refl_cdb[out + end];
            block->dt_ns[to] = block->dt_ns[out + end];
            to++;
        }
        for (uint32_t k = first; k < to; k++)
            block->echo[k] = (uint8_t)(kept > 0 ? (k - first + 1) | kept << 4 : 0);
    }
    return to - out;
}

uint32_t caster_report(struct caster *c, const struct cast_setup *s, const struct schedule_run *run,
                       const uint32_t *dt_ns, uint64_t pulse0, struct line_block *block, uint32_t out,
                       uint32_t *entries)
{
    const struct cast_detect *d = s->detect;
    struct echo_list *l = &c->list;
    kernel_detect(l->range_m, s->range_min_m, s->range_max_m, l->n, l->echo);
    if (d->surfaces != NULL) weigh_returns(d, l);
    make_keys(l, pulse0);
    find_echoes(c, s, run);
    caster_ends(c, CAST_DETECT);
    add_noise(c, s);
    caster_ends(c, CAST_NOISE);
    uint32_t echoes = number_echoes(c, d);
    write_entries(c, dt_ns, block, out);
    if (d->ball != NULL)
        detect_move_in_ball(d->ball, s->rotation, l->n, l->key, l->range_m, l->mirror_turn, l->pan_turn);
    *entries = l->n;
    if (s->layout == LINE_POLAR) {
        kernel_polar(s, l->range_m, l->mirror_turn, l->pan_turn, l->n, block->a + out, block->b + out, block->c + out);
    } else {
        uint32_t unfit = write_positions(c, s, run, block, out);
        echoes -= unfit;
        if (unfit != 0) *entries = number_again(l, block, out);
    }
    caster_ends(c, CAST_POSITIONS);
    return echoes;
}

uint32_t caster_detected(struct caster *c, const struct cast_setup *s, const struct schedule_run *run,
                         const uint32_t *dt_ns, uint32_t first, uint32_t n, struct line_block *block, uint32_t *at)
{
    struct origins from;
    uint32_t entries;
    if (c->profile != NULL) c->profile->last = c->profile->now();
    aim_beams(c, s, run, dt_ns, first, n, &from);
    const struct ray_set set = {.dx = c->dx,
                                .dy = c->dy,
                                .dz = c->dz,
                                .range_m = c->range_m,
                                .label = c->label,
                                .hit = c->hit,
                                .cosine = c->cosine,
                                .body = s->detect->surfaces != NULL ? c->body : NULL};
    caster_nearest(c, s, &from, &set, n);
    if (s->detect->depth > 0)
        caster_follow(c, s, &from, n);
    else
        list_hits(c, n);
    uint32_t echoes = caster_report(c, s, run, dt_ns, run->pulse0 + first, block, *at, &entries);
    *at += entries;
    return echoes;
}
