/* SPDX-License-Identifier: MIT */
/* Plausibility checks: values that are allowed, but hardly meant. Each gives one warning with its figures and the key
 * to look at. */
#include <math.h>

#include "core/angle.h"
#include "core/distance.h"
#include "core/mat3.h"
#include "drivers/protocol/protocol.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/site/steps.h"

/* Hardly any scene for a laser scanner is smaller or larger than this. The scale of a scene beyond these limits is
 * probably wrong by a factor of a thousand. */
static const double SMALL_M = 0.05, LARGE_M = 10000.0;

/* A scan is called mostly empty where a smaller share of its pulses hits a surface. */
static const double EMPTY_SHARE = 0.05;

enum { LOOK_ACROSS = 32, LOOK_UP = 32, LOOKS = LOOK_ACROSS * LOOK_UP, MAX_LINES = 1000 };

/* Returns the program of the configured pulse rate. It gives the head's smallest and largest range. */
static const struct config_program *program_of(const struct site *site)
{
    const struct config *cfg = site->cfg;
    return &cfg->profile.program[config_program_of(&cfg->profile, cfg->head.settings.prr_uhz)];
}

static void check_size(const struct site *site, const struct sh_report *report)
{
    const struct config *cfg = site->cfg;
    double size_m = 0.0;
    for (int i = 0; i < 3; i++)
        size_m = fmax(size_m, site->scene->max_m[i] - site->scene->min_m[i]);
    if (size_m >= SMALL_M && size_m <= LARGE_M) return;
    sh_warn(
        report,
        "%s: the scene is %.3g m large, but the head measures from %g to %g m: check scene.meshes[].scale, metres per "
        "unit, now %g",
        cfg->file, size_m, program_of(site)->range_min_m, program_of(site)->range_max_m, cfg->scene.mesh[0].scale);
}

/* Warns of lines without a pulse. Each line has the same window. Unless the pulse rate is a multiple of the line rate,
 * pulses shift from line to line, so some lines may have a pulse in the window and others none. */
static void check_lines(const struct site *site, const struct sh_report *report)
{
    const struct head_settings *s = &site->cfg->head.settings;
    struct schedule_spec spec;
    struct schedule_segment segment;
    struct schedule_line line;
    unsigned n = 0, empty = 0;
    site_fill_spec(site, s, &spec);
    schedule_start(&segment, &spec);
    for (; n < MAX_LINES; n++) {
        schedule_get_line(&segment, n, &line);
        if (line.pulse0 >= segment.end_pulse) break;
        empty += line.cast_end <= line.cast0;
    }
    if (empty == 0) return;
    const int64_t width_udeg = (s->line_stop_udeg - s->line_start_udeg + spec.sweep_udeg) % spec.sweep_udeg;
    const char *keys = site->emitter.kind == EMITTER_SPHERE       ? " (head.step_deg)"
                       : emitter_line_pulses(&site->emitter) == 0 ? " (head.prr_hz, lines_hz)"
                                                                  : "";
    sh_warn(report,
            "%s: head.line_start_deg, line_stop_deg: %u of %u lines cast no pulse: the window is %.4g deg wide, and "
            "pulses are %.4g deg apart%s",
            site->cfg->file, empty, n, 1e-6 * (double)width_udeg,
            1e-6 * (double)spec.sweep_udeg * (double)s->lines_uhz / (double)s->prr_uhz, keys);
}

/* Warns where the step of a sphere is rounded, so that a turn has a whole number of steps. */
static void check_step(const struct site *site, const struct sh_report *report)
{
    const struct emitter *e = &site->emitter;
    if (e->kind != EMITTER_SPHERE || emitter_sphere_is_exact(e)) return;
    const double asked_deg = 1e-6 * (double)e->asked_udeg;
    if (e->gaps == 0)
        sh_warn(report, "%s: head.step_deg: %.9g deg does not divide 360 deg: %u steps of %.9g deg are used",
                site->cfg->file, asked_deg, e->steps, 360.0 / e->steps);
    else
        sh_warn(
            report,
            "%s: head.step_deg: %.9g deg does not divide 180 and 360 deg: %u steps of %.9g deg are used from ring to "
            "ring, and %u of %.9g deg along a ring",
            site->cfg->file, asked_deg, e->gaps, 180.0 / e->gaps, e->steps, 360.0 / e->steps);
}

static void check_attributes(const struct site *site, const struct sh_report *report)
{
    const struct config *cfg = site->cfg;
    if (!cfg->output.attributes || cfg->signal.on) return;
    sh_warn(report, "%s: output.attributes: on, but signal.model is off: no echo has an amplitude%s", cfg->file,
            cfg->beam.mode == BEAM_SINGLE ? ", and with beam.mode single each has the pulse's width" : "");
}

static void check_colours(const struct site *site, const struct sh_report *report)
{
    const struct config *cfg = site->cfg;
    if (cfg->output.colour != COLOUR_REFLECTANCE || cfg->signal.on) return;
    sh_warn(
        report,
        "%s: output.colour: reflectance, but signal.model is off: no point has a reflectance, so all have the colour "
        "for a missing one",
        cfg->file);
}

static void check_fields(const struct site *site, const struct sh_report *report)
{
    const struct config *cfg = site->cfg;
    if (cfg->n_fields + cfg->n_inputs == 0 || cfg->links_are_not_here || config_speaks(cfg, PROTOCOL_COLA)) return;
    sh_warn(report, "%s: %s: no link has protocol: cola, so nothing evaluates them", cfg->file,
            cfg->n_inputs == 0   ? "fields"
            : cfg->n_fields == 0 ? "inputs"
                                 : "fields and inputs");
}

/* Warns of transparent surfaces without a rule. A file's transparency is for pictures; only the configuration says
 * whether a laser goes through. */
static void check_clear(const struct site *site, const struct sh_report *report)
{
    const struct config *cfg = site->cfg;
    const uint32_t n = site->detect.ghost != NULL ? site->detect.n_real : site->n_surfaces;
    struct site_clear clear = {.room = 320}; /* a warning is a line */
    for (uint32_t i = 0; i < n; i++)
        site_clear_add(&clear, site_surface(site, i), cfg->surface, cfg->n_surfaces);
    if (clear.n == 0) return;
    const char *const left = clear.n_left_out == 0 ? "" : "; check --scene-csv FILE lists all";
    sh_warn(report,
            "%s: %u surface%s transparent in the file, but scanned as opaque; only the configuration makes glass: "
            "surfaces: [%s]%s",
            cfg->file, clear.n, clear.n > 1 ? "s are" : " is", clear.rules[0] != '\0' ? clear.rules : "...", left);
}

static void check_reach(const struct site *site, uint32_t i, const struct sh_report *report)
{
    const double reach_m = program_of(site)->range_max_m, *p = site->station[i].at.position_m;
    int reached = distance_reaches(site->bvh, p, reach_m);
    for (uint32_t k = 0; k < site->n_movers && !reached; k++)
        reached = distance_reaches(site->mover[k].bvh, p, reach_m);
    if (reached) return;
    sh_warn(report, "station %u %s at %.10g %.10g %.10g m: no surface within range_max_m, %g m", i + 1,
            site->station[i].station->name, p[0], p[1], p[2], reach_m);
}

/* ---- the view of a station */

/* Warns of a head below its floor: then a surface is above it, and none under it. */
static int check_floor(const struct site *site, uint32_t i, const struct sh_report *report, struct sh_err *err)
{
    const struct site_station *s = &site->station[i];
    const double *p = s->at.position_m;
    double level[9];
    const int rc = placement_level(&site->anchor, p, level, err);
    if (rc != SH_OK) return rc;
    const double up[3] = {level[2], level[5], level[8]}, down[3] = {-level[2], -level[5], -level[8]};
    const double above_m = bvh_ray(site->bvh, p, up);
    if (!isnan(above_m) && isnan(bvh_ray(site->bvh, p, down)))
        sh_warn(
            report,
            "station %u %s at %.10g %.10g %.10g m: no surface below it, but one %.3g m above it: it may be under the "
            "floor",
            i + 1, s->station->name, p[0], p[1], p[2], above_m);
    return SH_OK;
}

/* Finds the mirror's and the pan's angle of a pulse; the pulses of all i are spread evenly over the first pan sweep. */
static void aim_in_frame(const struct schedule_segment *segment, int i, double *mirror_rad, double *pan_rad)
{
    struct schedule_line line;
    uint64_t k = segment->end_pulse * (2 * (uint64_t)i + 1) / (2 * LOOKS);
    schedule_get_line(segment, schedule_line_of(segment, k), &line);
    if (line.cast0 < line.cast_end)
        k = line.cast0 + (k - line.pulse0) * (line.cast_end - line.cast0) / (line.pulse_end - line.pulse0);
    *pan_rad = angle_rad(360.0 * schedule_pan_turn(segment, k));
    *mirror_rad = angle_rad(360.0 * schedule_mirror_turn(segment, k));
}

/* The same for directions that are spread evenly over the window of a scan. */
static void aim_in_window(const struct site *site, int i, double *line_rad, double *pan_rad)
{
    const struct head_settings *set = &site->cfg->head.settings;
    const double pan_deg = 1e-6 * (double)(set->pan_stop_udeg - set->pan_start_udeg);
    const double line_deg = 1e-6 * (double)(set->line_stop_udeg - set->line_start_udeg);
    const double across = (i % LOOK_ACROSS + 0.5) / LOOK_ACROSS, up = ((double)(i / LOOK_ACROSS) + 0.5) / LOOK_UP;
    *pan_rad = angle_rad(1e-6 * (double)set->pan_start_udeg + pan_deg * across);
    *line_rad = angle_rad(1e-6 * (double)set->line_start_udeg + line_deg * up);
}

/* Returns the range of what is seen from a station in direction i of LOOKS; NaN: nothing is. sweep: the first pan
 * sweep. */
static double look(const struct site *site, const struct site_station *s, const struct schedule_segment *sweep, int i)
{
    double line, pan, dir[3];
    if (site->emitter.kind == EMITTER_LINE)
        aim_in_window(site, i, &line, &pan);
    else
        aim_in_frame(sweep, i, &line, &pan);
    mat3_apply(s->at.rotation, (const double[3]){sin(pan) * cos(line), cos(pan) * cos(line), sin(line)}, dir);
    return bvh_ray(site->bvh, s->at.position_m, dir);
}

static void check_view(const struct site *site, uint32_t i, const struct sh_report *report)
{
    const struct config_program *program = program_of(site);
    const struct site_station *s = &site->station[i];
    const double *p = s->at.position_m;
    struct head_settings settings = site->cfg->head.settings;
    struct schedule_spec spec;
    struct schedule_segment sweep;
    int seen = 0, near = 0, far = 0;
    settings.frames = 1;
    site_fill_spec(site, &settings, &spec);
    schedule_start(&sweep, &spec);
    for (int k = 0; k < LOOKS; k++) {
        const double range_m = look(site, s, &sweep, k);
        near += range_m < program->range_min_m;
        far += range_m > program->range_max_m;
        seen += range_m >= program->range_min_m && range_m <= program->range_max_m;
    }
    if (near > LOOKS / 2)
        sh_warn(
            report,
            "station %u %s at %.10g %.10g %.10g m: of %d directions %d hit something nearer than range_min_m, %g m: "
            "the station may be inside an object",
            i + 1, s->station->name, p[0], p[1], p[2], (int)LOOKS, near, program->range_min_m);
    if (seen >= EMPTY_SHARE * LOOKS) return;
    sh_warn(
        report,
        "station %u %s at %.10g %.10g %.10g m: the scan is mostly empty: of %d directions %d hit something from %g to "
        "%g m away, %d something nearer, %d something farther",
        i + 1, s->station->name, p[0], p[1], p[2], (int)LOOKS, seen, program->range_min_m, program->range_max_m, near,
        far);
}

/* Checks what stations see. Moving meshes may fill a view, so with these only the reach is checked: a surface must be
 * within range_max_m. Nothing is checked with a path, which leads elsewhere. Where there are many stops, only some are
 * checked. */
static int check_stations(const struct site *site, const struct sh_report *report, struct sh_err *err)
{
    const uint32_t step = site->n_stations / CONFIG_MAX_STATIONS + 1;
    int rc = SH_OK;
    for (uint32_t i = 0; i < site->n_stations && rc == SH_OK && !site->moving; i += step) {
        if (!config_serves(site->cfg, i)) continue;
        check_reach(site, i, report);
        if (site->n_movers > 0) continue;
        rc = check_floor(site, i, report, err);
        if (rc == SH_OK) check_view(site, i, report);
    }
    return rc;
}

/* Warns of the first station far outside of the grid that the scene's coordinates are said to be in. Mostly the scene
 * has coordinates of its own, near 0. The limits of UTM and UPS are those of MGRS (GeographicLib, UTMUPS), with a wide
 * overlap between zones. */
static void check_grid(const struct site *site, const struct sh_report *report)
{
    const struct geoframe *f = &site->anchor.frame;
    if (!site->anchor.known || f->kind != GEOFRAME_GRID) return;
    const double least_m = f->zone != 0 ? 1e5 : f->north ? 13e5 : 8e5;
    const double most_m = f->zone != 0 ? 9e5 : f->north ? 27e5 : 32e5;
    for (uint32_t i = 0; i < site->n_stations; i++) {
        const double easting_m = site->station[i].at.position_m[0];
        if (easting_m >= least_m && easting_m <= most_m) continue;
        sh_warn(report,
                "station %u %s: easting %.10g m is far outside of the scene's grid (scene.anchor), whose eastings are "
                "%.0f to %.0f m; a scene with coordinates of its own is anchored with source: explicit",
                i + 1, site->station[i].station->name, easting_m, least_m, most_m);
        return;
    }
}

int site_check_plausibility(const struct site *site, const struct sh_report *report, struct sh_err *err)
{
    check_size(site, report);
    check_step(site, report);
    check_lines(site, report);
    check_fields(site, report);
    check_attributes(site, report);
    check_colours(site, report);
    check_clear(site, report);
    check_grid(site, report);
    return check_stations(site, report, err);
}
