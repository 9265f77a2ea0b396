/* SPDX-License-Identifier: MIT */
/* Places to compare, on a grid or from a file, and the rays that they are compared by. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/angle.h"
#include "core/csv.h"
#include "core/grow.h"
#include "core/studio/viewpoint.h"
#include "core/vec3.h"
#include "firmware_sim/app/studio/coverage/next.h"
#include "firmware_sim/config/profile.h"
#include "firmware_sim/config/places.h"

enum { MOST_PLACES = 100000, PULSES = 40000 };

/* ---- places */

static int add_place(struct coverage_finder *f, const struct coverage_next_place *place, struct sh_err *err)
{
    if (!grow(&f->next->place, &f->room, f->next->n + 1, sizeof *place))
        return sh_fail(err, SH_ENOMEM, "no memory for places to stand");
    f->next->place[f->next->n++] = *place;
    return SH_OK;
}

/* The page has no options of a command line. */
static int fail_no_place(const struct coverage_finder *f, struct sh_err *err)
{
    const double room_m = f->o->height_m + 0.2;
    if (f->o->of_page)
        return sh_fail(err, SH_EINPUT,
                       "no place to stand: no floor has %.3g m of room above it; allowed is another height_m", room_m);
    return sh_fail(err, SH_EINPUT,
                   "--grid %g: no place to stand: no floor there has %.3g m of room above it; allowed is another grid, "
                   "--height or --at",
                   f->o->grid_m, room_m);
}

static int check_upright(const struct coverage_finder *f, struct sh_err *err)
{
    const struct placement_anchor *anchor = &f->site->anchor;
    if (!anchor->known || anchor->frame.kind != GEOFRAME_ECEF) return SH_OK;
    return sh_fail(err, SH_EINPUT, "%s: scene.anchor.source: ecef, where z is not up, so a grid has no floors%s",
                   site_file(f->site), f->o->of_page ? "" : "; allowed is --candidates");
}

static int find_on_grid(struct coverage_finder *f, struct sh_err *err)
{
    const struct scene *scene = f->site->scene;
    struct viewpoint_grid grid = {.step_m = f->o->grid_m, .height_m = f->o->height_m};
    struct viewpoint_place *found = NULL;
    uint32_t n = 0;
    for (int i = 0; i < 3; i++) { /* the lowest floor that a ray finds may lie below the scene, by its rounding */
        const double low_m = i == 2 ? -INFINITY : scene->min_m[i], high_m = i == 2 ? INFINITY : scene->max_m[i];
        grid.min_m[i] = isnan(f->o->area_m[0][i]) ? low_m : f->o->area_m[0][i];
        grid.max_m[i] = isnan(f->o->area_m[1][i]) ? high_m : f->o->area_m[1][i];
    }
    int rc = check_upright(f, err);
    if (rc == SH_OK) rc = viewpoint_places(f->site->bvh, &grid, f->report, &found, &n, err);
    if (rc == SH_OK && n > MOST_PLACES)
        rc = sh_fail(err, SH_EINPUT,
                     "--grid %g: %u places to stand; allowed are %d: use a wider grid, or a part with --at",
                     f->o->grid_m, n, MOST_PLACES);
    for (uint32_t i = 0; i < n && rc == SH_OK; i++) {
        struct coverage_next_place place = {.heading_deg = f->site->station[f->result->base].station->heading_deg,
                                            .floor_m = found[i].floor_m};
        memcpy(place.position_m, found[i].position_m, sizeof place.position_m);
        rc = add_place(f, &place, err);
    }
    free(found);
    return rc == SH_OK && n == 0 ? fail_no_place(f, err) : rc;
}

enum { X, Y, Z, HEADING };

static int read_row(struct coverage_finder *f, struct csv *csv, struct sh_err *err)
{
    const struct coverage_next_place place = {
        .position_m = {csv->value[X], csv->value[Y], csv->value[Z]},
        .heading_deg =
            csv->has & 1u << HEADING ? csv->value[HEADING] : f->site->station[f->result->base].station->heading_deg,
        .floor_m = (double)NAN};
    for (int i = 0; i < 4; i++)
        if (!(fabs(csv->value[i]) <= (i == HEADING ? 360.0 : 1e9)))
            return sh_fail(err, SH_EINPUT,
                           "%s, line %llu: %g is out of range; allowed are metres within 1e9, and "
                           "-360 to 360 deg",
                           f->o->candidates, (unsigned long long)csv->line, csv->value[i]);
    if (f->next->n == MOST_PLACES)
        return sh_fail(err, SH_EINPUT, "%s: more than %d places", f->o->candidates, MOST_PLACES);
    return add_place(f, &place, err);
}

static int read_candidates(struct coverage_finder *f, struct sh_err *err)
{
    static const char *const COLUMNS[] = {"x_m", "y_m", "z_m", "heading_deg", NULL};
    const uint32_t needed = 1u << X | 1u << Y | 1u << Z;
    struct csv csv;
    int rc = csv_open(&csv, f->o->candidates, COLUMNS, f->report, err), more = 1;
    if (rc == SH_OK && (csv.has & needed) != needed)
        rc =
            sh_fail(err, SH_EINPUT, "%s: its first line needs x_m,y_m,z_m, and may have heading_deg", f->o->candidates);
    while (rc == SH_OK && (more = csv_next(&csv, err)) == 1)
        rc = read_row(f, &csv, err);
    csv_close(&csv);
    if (more < 0) rc = more;
    if (rc == SH_OK && f->next->n == 0) rc = sh_fail(err, SH_EINPUT, "%s: there are no places in it", f->o->candidates);
    return rc;
}

/* ---- directions, of a level head with heading 0 */

static int add_direction(struct coverage_finder *f, size_t room[2], const double dir[3], double sr, struct sh_err *err)
{
    if (!grow(&f->dir, &room[0], f->n_dir + 1, sizeof *f->dir) ||
        !grow(&f->each_sr, &room[1], f->n_dir + 1, sizeof *f->each_sr))
        return sh_fail(err, SH_ENOMEM, "no memory for directions");
    memcpy(f->dir[f->n_dir], dir, sizeof *f->dir);
    f->each_sr[f->n_dir++] = sr;
    return SH_OK;
}

/* Whether a level head scans that way, past its tripod. */
static int looks(const struct coverage_finder *f, const double dir[3])
{
    const struct site_tripod *t = &f->site->station[f->result->base].tripod;
    return site_scans(f->site, f->result->base, dir) && (t->from == NULL || -dir[2] <= t->cast.cos_opening);
}

/* Spreads directions over rings of equal steps, within the head's field of view. */
static int spread_directions(struct coverage_finder *f, struct sh_err *err)
{
    const double step_rad = angle_rad(f->o->step_deg);
    const uint32_t rings = (uint32_t)ceil(M_PI / step_rad);
    size_t room[2] = {0, 0};
    int rc = SH_OK;
    for (uint32_t i = 0; i < rings && rc == SH_OK; i++) {
        const double low = -M_PI_2 + M_PI * i / rings, high = -M_PI_2 + M_PI * (i + 1.0) / rings;
        const double z = 0.5 * (sin(low) + sin(high)), r = sqrt(1.0 - z * z);
        const uint32_t n = (uint32_t)fmax(ceil(2.0 * M_PI * r / step_rad), 3.0);
        const double sr = 2.0 * M_PI * (sin(high) - sin(low)) / n;
        for (uint32_t k = 0; k < n && rc == SH_OK; k++) {
            const double turn = 2.0 * M_PI * (k + 0.5) / n;
            const double dir[3] = {r * sin(turn), r * cos(turn), z};
            if (looks(f, dir)) rc = add_direction(f, room, dir, sr, err);
        }
    }
    return rc;
}

/* The beams of a planar head lie in one plane, and those of the emitter `beams` lie on cones. So the rays are some of
 * the head's pulses, and each cell of a surface that a ray hits counts with its whole area. */
static int draw_directions(struct coverage_finder *f, struct sh_err *err)
{
    struct coverage_scan_at at;
    size_t room[2] = {0, 0};
    int rc = SH_OK;
    coverage_scan_of(f->site, f->result->base, &at);
    const struct schedule_segment *seg = &at.scan.segment;
    const uint64_t all = seg->end_pulse - seg->k0, n = all < PULSES ? all : PULSES;
    for (uint64_t i = 0; i < n && rc == SH_OK; i++) {
        const uint64_t k = seg->k0 + all / n * i + all % n * i / n;
        struct schedule_line line;
        schedule_get_line(seg, schedule_line_of(seg, k), &line);
        if (k < line.cast0 || k >= line.cast_end) continue;
        const double mirror = 2.0 * M_PI * schedule_mirror_turn(seg, k), pan = 2.0 * M_PI * schedule_pan_turn(seg, k);
        rc = add_direction(f, room, (const double[3]){sin(pan) * cos(mirror), cos(pan) * cos(mirror), sin(mirror)},
                           INFINITY, err);
    }
    f->next->whole_cells = 1;
    return rc;
}

static int choose_directions(struct coverage_finder *f, struct sh_err *err)
{
    const enum emitter_kind kind = f->site->emitter.kind;
    const int of_pulses = kind == EMITTER_PLANAR || kind == EMITTER_BEAMS;
    if (of_pulses && f->o->step_given)
        return sh_fail(err, SH_EINPUT,
                       "--step-deg: head profile %s scans planes or cones, so places are compared by its pulses; leave "
                       "--step-deg out",
                       site_profile(f->site)->name);
    int rc = of_pulses ? draw_directions(f, err) : spread_directions(f, err);
    f->next->directions = f->n_dir;
    f->next->step_deg = f->o->step_deg;
    if (rc == SH_OK && f->n_dir == 0)
        rc = sh_fail(err, SH_EINPUT,
                     "--step-deg %g: no ray lies within the head's field of view; allowed is a smaller step",
                     f->o->step_deg);
    return rc;
}

int coverage_next_open(const struct coverage_next_options *options, const struct coverage_result *result,
                       const struct sh_report *report, struct coverage_next *next, struct coverage_finder *finder,
                       struct sh_err *err)
{
    *finder =
        (struct coverage_finder){.o = options, .result = result, .site = result->site, .report = report, .next = next};
    const int rc = options->candidates != NULL ? read_candidates(finder, err) : find_on_grid(finder, err);
    return rc == SH_OK ? choose_directions(finder, err) : rc;
}
