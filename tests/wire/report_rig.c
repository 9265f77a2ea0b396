/* SPDX-License-Identifier: MIT */
#include "tests/wire/report_rig.h"

#include <math.h>

static const double AT[N_STATIONS][3] = {{0, 0, 0.1}, {1, 1, 0.2}};
/* By the profile full-sweep: sigma of the range, steps of its encoders; and by the formats: polar ranges and text. */
static const double SIGMA_M = 0.003, STEP_RAD = 2.0 * M_PI / 1048576.0, RANGE_STEP_M = 1e-6, TEXT_STEP_M = 1e-6;

static const char CONFIG[] = "head: {profile: full-sweep, prr_hz: 20000, lines_hz: 100, pan_deg_s: 240, frames: 1}\n"
                             "scene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
                             "stations:\n  - {name: first, position_m: [0, 0, 0.1]}\n"
                             "  - {name: second, position_m: [1, 1, 0.2]}\n"
                             "output: {layout: polar}\nnoise: {range: 'on'}\nbeam: {mode: single}\n";

/* Returns the wall that a level beam meets, and how far away it is. */
static int meet(const double from[3], const double u[2], double *range_m)
{
    int wall = -1;
    *range_m = INFINITY;
    for (int w = 0; w < 4; w++) {
        const double r = ((w & 1 ? ROOM_MAX : ROOM_MIN)[w / 2] - from[w / 2]) / u[w / 2];
        if (!(r > 0.0) || r >= *range_m) continue;
        *range_m = r;
        wall = w;
    }
    return wall;
}

/* Cells begin at the room's corner. room.obj cuts each wall along the diagonal that runs up along its axis
 * (tests/wire/room.c). */
static void put_into_cells(struct made *m, const double at[3])
{
    const int across = 1 - m->wall / 2;
    const double x = (at[across] - ROOM_MIN[across]) / (ROOM_MAX[across] - ROOM_MIN[across]);
    const double z = (at[2] - ROOM_MIN[2]) / (ROOM_MAX[2] - ROOM_MIN[2]);
    m->cell[0] = (int)floor(m->p[across] - ROOM_MIN[across]);
    m->cell[1] = (int)floor(m->p[2] - ROOM_MIN[2]);
    m->triangle = z > x;
}

/* Level beams move along the wall with the pan, and not towards it with the mirror. */
static void make_near(int i, struct made *m)
{
    const double turn = 0.31 + 0.47 * (i / 4) + 0.03 * (i % 4), u[2] = {cos(turn), sin(turn)};
    double exact_m, at[3];
    *m = (struct made){.station = i / 4 % 3 == 2, .along_m = 0.0008 * (i * 5 % 13 - 6) + 0.00031};
    const double *from = AT[m->station];
    m->wall = meet(from, u, &exact_m);
    m->label = i == 17 ? 0xffff : m->wall;
    m->cosine = fabs(u[m->wall / 2]);
    m->range_m = exact_m + m->along_m;
    m->distance_m = fabs(m->along_m) * m->cosine;
    const double tangent = sqrt(1.0 - m->cosine * m->cosine) / m->cosine;
    m->counts_m =
        sqrt((pow(RANGE_STEP_M, 2) + pow(m->range_m * STEP_RAD * tangent, 2) + pow(TEXT_STEP_M / m->cosine, 2)) / 12.0);
    for (int k = 0; k < 3; k++) {
        m->p[k] = from[k] + (k < 2 ? m->range_m * u[k] : 0.0);
        at[k] = from[k] + (k < 2 ? exact_m * u[k] : 0.0);
    }
    put_into_cells(m, at);
    m->t_s = 1.0 + 0.004 * i + (i >= 20 ? 0.5 : 0.0) + (i >= 41 ? 0.25 : 0.0) - (i >= 50 ? 1.1 : 0.0);
    m->echo_count = i % 5 == 0 ? 2 : i % 7 == 0 ? 17 : 1;
    m->echo = m->echo_count == 2 && i % 2 == 1 ? 2 : 1;
}

void report_make(struct made all[N_POINTS])
{
    for (int i = 0; i < N_NEAR; i++)
        make_near(i, &all[i]);
    all[N_NEAR] = (struct made){.wall = -1,
                                .label = 0xffff,
                                .p = {NAN, NAN, NAN},
                                .distance_m = NAN,
                                .range_m = NAN,
                                .cosine = NAN,
                                .t_s = 0.5};
    all[N_NEAR + 1] = (struct made){.wall = 1,
                                    .label = 1,
                                    .p = {900, AT[0][1], AT[0][2]},
                                    .distance_m = INFINITY,
                                    .cosine = NAN, /* it lies on nothing */
                                    .range_m = 900 - AT[0][0],
                                    .t_s = NAN,
                                    .echo = 1,
                                    .echo_count = 1};
}

void report_write(const struct wire *wire, const struct made all[N_POINTS])
{
    room_write(wire);
    wire_write_text(wire, "made.yaml", CONFIG);
    FILE *f = fopen(wire_path(wire, "made.ply"), "w");
    assert_non_null(f);
    fprintf(f,
            "ply\nformat ascii 1.0\nelement vertex %d\nproperty double x\nproperty double y\nproperty double z\n"
            "property uchar station\nproperty ushort label\nproperty double time\nproperty uchar echo\n"
            "property uchar echo_count\nend_header\n",
            N_POINTS);
    for (int i = 0; i < N_POINTS; i++)
        fprintf(f, "%.17g %.17g %.17g %d %d %.17g %d %d\n", all[i].p[0], all[i].p[1], all[i].p[2], all[i].station + 1,
                all[i].label, all[i].t_s, all[i].echo, all[i].echo_count);
    assert_int_equal(fclose(f), 0);
}

void report_run(struct wire *wire, const char *const *more)
{
    char config[256], cloud[256];
    const char *args[WIRE_MAX_ARGS] = {"report", config, cloud, "--cell-m", "1"};
    size_t n = 5;
    snprintf(config, sizeof config, "%s", wire_path(wire, "made.yaml"));
    snprintf(cloud, sizeof cloud, "%s", wire_path(wire, "made.ply"));
    for (; *more != NULL; more++)
        args[n++] = *more;
    wire_run(wire, args, 1);
}

/* ---- figures of some of the points */

static int is_of(const struct made *m, enum group group, double from, double to)
{
    const double value[] = {0, m->station, m->label, m->range_m, acos(m->cosine) * 180.0 / M_PI};
    return value[group] >= from && value[group] < to;
}

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double nearest_rank(const double *sorted, size_t n, double share)
{
    return n == 0 ? (double)NAN : sorted[(size_t)ceil(share * (double)n) - 1];
}

struct wanted report_want(const struct made all[N_POINTS], enum group group, double from, double to)
{
    struct wanted w = {.max_m = NAN, .along_max_m = NAN};
    double sorted[N_POINTS], d2 = 0, a2 = 0, c2 = 0;
    size_t n = 0;
    for (int i = 0; i < N_POINTS; i++) {
        const struct made *m = &all[i];
        if (isnan(m->distance_m) || !is_of(m, group, from, to)) continue;
        w.points++;
        w.far += isinf(m->distance_m) ? 1 : 0;
        if (isinf(m->distance_m)) continue;
        sorted[n++] = m->distance_m;
        w.mean_m += m->distance_m;
        d2 += pow(m->distance_m, 2);
        w.along_mean_m += m->along_m;
        a2 += pow(m->along_m, 2);
        c2 += pow(m->counts_m, 2);
        w.max_m = fmax(w.max_m, m->distance_m);
        w.along_max_m = fmax(w.along_max_m, fabs(m->along_m));
    }
    qsort(sorted, n, sizeof *sorted, ascending);
    w.near = (double)n;
    w.mean_m /= w.near;
    w.rms_m = sqrt(d2 / w.near);
    w.p50_m = nearest_rank(sorted, n, 0.5);
    w.p95_m = nearest_rank(sorted, n, 0.95);
    w.p999_m = nearest_rank(sorted, n, 0.999);
    w.along_mean_m /= w.near;
    w.along_rms_m = sqrt(a2 / w.near);
    w.expected_rms_m = sqrt(SIGMA_M * SIGMA_M + c2 / w.near);
    w.z_mean = w.along_mean_m / SIGMA_M;
    w.z_rms = w.along_rms_m / SIGMA_M;
    w.z_counts = sqrt(c2 / w.near) / SIGMA_M;
    return w;
}

/* ---- density */

struct cell {
    const struct made *first;
    size_t n;
    double range_m; /* the sum */
};

static int by_points(const void *a, const void *b)
{
    const struct cell *x = a, *y = b;
    return (x->n > y->n) - (x->n < y->n);
}

static int is_in(const struct cell *c, const struct made *m)
{
    return c->first->station == m->station && c->first->wall == m->wall && c->first->cell[0] == m->cell[0] &&
           c->first->cell[1] == m->cell[1];
}

/* Fills the cells with these mean ranges and returns how many there are. */
static size_t cells_of(const struct made all[N_POINTS], int station, double from_m, double to_m, struct cell *cell)
{
    size_t n = 0, kept = 0;
    for (int i = 0; i < N_NEAR; i++) {
        size_t k = 0;
        while (k < n && !is_in(&cell[k], &all[i]))
            k++;
        if (k == n) cell[n++] = (struct cell){.first = &all[i]};
        cell[k].n++;
        cell[k].range_m += all[i].range_m;
    }
    for (size_t k = 0; k < n; k++) {
        const double mean_m = cell[k].range_m / (double)cell[k].n;
        if ((station < 0 || cell[k].first->station == station) && mean_m >= from_m && mean_m < to_m)
            cell[kept++] = cell[k];
    }
    qsort(cell, kept, sizeof *cell, by_points);
    return kept;
}

/* Returns the density that a share of the points does not exceed. */
static double density_at(const struct cell *cell, size_t n, double share)
{
    size_t points = 0, sum = 0, k = 0;
    for (size_t i = 0; i < n; i++)
        points += cell[i].n;
    if (n == 0) return (double)NAN;
    while ((double)(sum += cell[k].n) < share * (double)points)
        k++;
    return (double)cell[k].n;
}

struct density report_density(const struct made all[N_POINTS], int station, double from_m, double to_m)
{
    struct cell cell[N_NEAR];
    const size_t n = cells_of(all, station, from_m, to_m, cell);
    return (struct density){(double)n, density_at(cell, n, 0.05), density_at(cell, n, 0.5), density_at(cell, n, 0.95)};
}

/* ---- times: a scan begins where time goes back; two lines without a point are a pause */

struct times report_times(const struct made all[N_POINTS], int station)
{
    struct times t = {.first_s = NAN, .last_s = NAN};
    for (int i = 0; i < N_POINTS; i++) {
        const double now_s = all[i].t_s, gap_s = now_s - t.last_s;
        if (all[i].station != station || isnan(now_s)) continue;
        if (t.n++ == 0.0) t.first_s = now_s;
        t.scans += !(gap_s >= 0.0);
        if (gap_s >= 0.0) t.span_s += gap_s;
        t.gaps += gap_s > 2.0 / REPORT_LINES_HZ;
        if (gap_s > t.longest_s) t.longest_at_s = t.last_s;
        if (gap_s > t.longest_s) t.longest_s = gap_s;
        t.last_s = now_s;
    }
    return t;
}

double report_range_step(const struct made all[N_POINTS], int *n)
{
    static const double steps[] = {0.1, 0.2, 0.5, 1, 2, 5};
    double far_m = 0.0;
    size_t k = 0;
    for (int i = 0; i < N_NEAR; i++)
        far_m = fmax(far_m, all[i].range_m);
    while (12.0 * steps[k] < far_m)
        k++;
    *n = (int)floor(far_m / steps[k]) + 1;
    return steps[k];
}
