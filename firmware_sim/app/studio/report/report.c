/* SPDX-License-Identifier: MIT */
/* scanhead report: how far a recording's points lie from the scene of its configuration. The command; report.h says
 * where its parts are. */
#include <stddef.h>
#include <stdio.h>

#include "core/newfile.h"
#include "firmware_sim/app/studio/report/report.h"

static int write_all(struct report *r, struct sh_err *err)
{
    if (r->f.stats.points == 0)
        return sh_fail(err, SH_EINPUT, "%s: it has no points (%zu shots without echo)", r->cloud_path,
                       r->f.stats.empty);
    int rc = r->html_path != NULL ? report_write_html(r, err) : SH_OK;
    if (rc == SH_OK && r->json) rc = app_write_json("-", report_put_json, r, err);
    if (rc == SH_OK && !r->json) report_print_text(r);
    const char *why = app_write_failure(stdout);
    if (rc == SH_OK && why != NULL) rc = sh_fail(err, SH_EIO, "standard output: %s", why);
    if (rc != SH_OK || r->f.stats.beyond == 0) return rc;
    return sh_fail(err, SH_ESTATE, "%s: %zu of %zu points are farther than %g m from the scene", r->cloud_path,
                   r->f.stats.beyond, r->f.stats.points, r->tolerance_m);
}

static int report_report(struct config *cfg, void *ctx, struct sh_err *err)
{
    struct report *r = ctx;
    app_catch_signals();
    r->cfg = cfg;
    r->cloud_path = r->in.operand[1];
    int rc = r->html_path != NULL ? newfile_check(r->html_path, err) : SH_OK;
    if (rc == SH_OK) rc = report_work(r, err);
    if (rc == SH_OK) rc = write_all(r, err);
    report_free(r);
    return rc;
}

static int report_run(int argc, char **argv)
{
    struct report r = {.tolerance_m = 0.001, .max_m = 10};
    int status = app_parse(&app_report, argc, argv, &r.in, &r);
    if (status == APP_GO_ON && r.tolerance_m > r.max_m)
        status = app_usage(&app_report, "--tolerance-m %g is more than --max-m %g", r.tolerance_m, r.max_m);
    if (status == APP_GO_ON && r.html_path != NULL && !app_ends_in(r.html_path, ".html") &&
        !app_ends_in(r.html_path, ".htm"))
        status =
            app_usage(&app_report, "--html %s: the file is a page; allowed is a name that ends in .html", r.html_path);
    return status == APP_GO_ON ? app_with_config(&r.in, report_report, &r) : status;
}

#define AT(member) offsetof(struct report, member)
#define FARTHEST_M 1e9 /* no scene is larger */

/* clang-format off */
static const struct app_option OPTIONS[] = {
    {APP_NUMBER, "tolerance-m", "T", .min = 0.0, .max = FARTHEST_M, .at = AT(tolerance_m),
     .help = "largest allowed distance of a point from the scene (default 0.001)"},
    {APP_NUMBER, "max-m", "M", .min = 1e-9, .max = FARTHEST_M, .at = AT(max_m),
     .help = "distance up to which the scene is searched; points farther away count as far, and fail (default 10)"},
    {APP_NUMBER, "cell-m", "C", .min = 1e-3, .max = 1000.0, .at = AT(cell_m),
     .help = "side of the cells in which the density of points is counted (default: 0.1, doubled until half of the points "
             "are in cells with 16 or more)"},
    {APP_FLAG, "json", NULL, .at = AT(json),
     .help = "print the figures as JSON, in metres: points, empty, ghosts, mean_m, rms_m, p50_m, p95_m, p999_m, "
             "max_m, beyond, far, tolerance_m, surfaces_hit, surfaces, triangles_hit, triangles, worst, verdict, all, "
             "stations, by_range, by_incidence, by_surface, distances, along_beam, shots_by_echoes"},
    {APP_TEXT, "html", "FILE.html", .at = AT(html_path), .file = APP_WRITES,
     .help = "also write a page with tables and pictures: one file, which needs no other files"},
    OPTION_SET,
    {APP_FLAG, "quiet", NULL, .at = AT(quiet), .help = "no progress"},
    OPTION_END
};
/* clang-format on */

static const char NOTES[] =
    "CONFIG is the configuration of the recording: its scene, stations, output.crs and output.layout are used.\n"
    "CLOUD is a LAS file, or a PLY file with x, y, z and, where it has them, station, echo and label, as\n"
    "scanhead record writes both. Points without a station count as points of the first one. NaN three times is\n"
    "a shot without echo.\n"
    "\n"
    "Each point's distance to the nearest triangle of the scene is measured in double precision. Points seen in\n"
    "mirrors are away from all surfaces: with the mirrors in CONFIG (surfaces) they are left out. Mean, RMS,\n"
    "percentiles (nearest rank) and maximum are over all points that are not far. Percentiles are of the\n"
    "distances, which are never negative.\n"
    "\n"
    "Along the beam: the line from the station through a point is followed to the scene. Measured minus exact\n"
    "range is given for points on smooth faces, away from edges. The column `expected` has the RMS that noise and\n"
    "the rounding of angles and coordinates give.\n"
    "The last line says whether the points are as good as expected: without noise each point must be within its\n"
    "bound (that of the plan, and half a count on each axis); with noise the RMS of deviation over sigma must be 1.\n"
    "Heads that moved are not judged, since there are only distances, nor are heads with errors of the instrument.\n"
    "For all others a point farther than --max-m fails. With noise or a footprint only points on smooth faces are\n"
    "judged, and at least half of all points must lie there.\n"
    "\n"
    "Density is that of one station's points, in squares of --cell-m on each surface. Squares at a border count as\n"
    "whole ones. If there are more than 3 million, their side is doubled.\n"
    "\n"
    "Memory: about 90 bytes a point, 9 GB for 100 million points.\n"
    "\n"
    "Bodies that move are at their places of the station's stop (platform.kind: stops). Points on bodies that moved\n"
    "during a scan are refused.\n"
    "\n"
    "Exit status: 0 all points are within the tolerance, 1 some are not, 2 wrong usage or input.\n";

const struct app_command app_report = {
    .name = "report",
    .operand = {"CONFIG", "CLOUD"},
    .summary = "distance of a recording's points from the configuration's scene",
    .options = OPTIONS,
    .notes = NOTES,
    .run = report_run,
};
