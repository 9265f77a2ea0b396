/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/studio/init/mesh.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/crs.h"
#include "core/geotiff.h"
#include "core/text.h"
#include "firmware_sim/app/app.h"

/* A mesh without a unit that would be larger than LARGEST_M is taken to be in millimetres, unless it is a survey, or
 * its coordinates are those of a projected system. */
static const double LARGEST_M = 2000.0, LARGEST_SURVEY_M = 50000.0;
/* In millimetres, a mesh less high than this would be a plate thinner than half a metre. */
static const double LEAST_HEIGHT_MM = 500.0;

double init_largest_m(const struct scene *scene)
{
    double size = 0.0;
    for (int i = 0; i < 3; i++)
        size = fmax(size, scene->max_m[i] - scene->min_m[i]);
    return size;
}

/* Collada and IFC have units of the file, and Collada has axes, too. Their readers convert all to metres and y up. */
static const char *said_by(const char *file)
{
    if (text_has_ending(file, ".dae") || text_has_ending(file, ".ifc")) return "the file is converted to it";
    return text_has_ending(file, ".fbx") ? "as the file says" : "as the format defines it";
}

/* --up turns the mesh so that y or z becomes z. It can do nothing about other axes. */
static void warn_of_axes(const char *name, const struct scene_says *says, int y_up)
{
    if (says->up == 1 || says->up < 0)
        sh_warn(&app_report_stderr,
                "%s: its %s%c axis points up, which no key can set: with up: %c the mesh %s; export it with y or z up",
                name, says->up < 0 ? "-" : "", "xyz"[abs(says->up) - 1], y_up ? 'y' : 'z',
                says->up == (y_up ? -2 : -3) ? "is upside down" : "lies on its side");
    if (says->is_left_handed)
        sh_warn(&app_report_stderr,
                "%s: its axes are left-handed, which no key can set: the mesh is mirrored; export it with right-handed "
                "axes",
                name);
}

static void choose_up(const struct init_wish *wish, const char *name, const struct scene *scene, struct init_mesh *as)
{
    const int says = scene->says.up;
    const char *from = "given by --up";
    int y_up = says == 2 || says == -2;
    if (wish->up != NULL)
        y_up = strcmp(wish->up, "y") == 0;
    else if (says == 2 || says == 3)
        from = said_by(wish->file);
    else
        from = says == 0 ? "assumed: the file doesn't say; in many files y is up" : "assumed";
    as->up = y_up ? SCENE_UP_Y : SCENE_UP_Z;
    snprintf(as->up_from, sizeof as->up_from, "%s", from);
    warn_of_axes(name, &scene->says, y_up);
    if (wish->up == NULL && says == 0)
        sh_warn(
            &app_report_stderr,
            "%s: the file does not give the axis that points up: z is assumed; if the mesh lies on its side, use --up "
            "y",
            name);
}

/* Eastings and northings of projected systems are large compared with the size of the mesh. If they were millimetres,
 * the mesh would lie some 100 m from its origin, and nobody places a small mesh like that on purpose. */
static int is_projected(const struct scene *scene, const double middle[3])
{
    const double least = 50000.0, large = 200000.0, times = 20.0;
    double up_to = 0.0, second = 0.0;
    for (int k = 0; k < 3; k++) {
        const double x = fabs(middle[k]);
        second = x > up_to ? up_to : fmax(second, x);
        up_to = fmax(up_to, x);
    }
    return up_to >= large && second >= least && up_to >= times * init_largest_m(scene);
}

/* Whether a mesh is wide, flat and level, like a survey of ground. A building is higher, and furniture is not ten times
 * as wide as it is high. */
static int is_survey(const struct scene *scene, int y_up)
{
    const double *low = scene->min_m, *high = scene->max_m;
    const int up = y_up ? 1 : 2, other = y_up ? 2 : 1;
    const double height = high[up] - low[up], width = fmin(high[0] - low[0], high[other] - low[other]);
    return init_largest_m(scene) <= LARGEST_SURVEY_M && height < LEAST_HEIGHT_MM && width > 10.0 * height;
}

/* Guesses metres per unit from the mesh. why: the reason, or empty. */
static double guess_unit(const struct scene *scene, int y_up, char *why, size_t len)
{
    double middle[3];
    for (int k = 0; k < 3; k++)
        middle[k] = 0.5 * (scene->min_m[k] + scene->max_m[k]);
    why[0] = '\0';
    if (is_projected(scene, middle)) {
        snprintf(why, len, "its coordinates, near %.7g %.7g %.7g, are those of a projected system", middle[0],
                 middle[1], middle[2]);
        return 1.0;
    }
    if (init_largest_m(scene) <= LARGEST_M) return 1.0;
    if (!is_survey(scene, y_up)) return 0.001;
    snprintf(why, len, "it is as wide and flat as a survey, and would be a thin plate in millimetres");
    return 1.0;
}

static void choose_scale(const struct init_wish *wish, const char *name, const struct scene *scene,
                         struct init_mesh *as)
{
    const double size = init_largest_m(scene);
    as->scale = wish->scale;
    snprintf(as->scale_from, sizeof as->scale_from, "given by --scale");
    if (wish->scale > 0.0) return;
    if (scene->says.unit_m > 0.0) {
        as->scale = scene->says.unit_m;
        snprintf(as->scale_from, sizeof as->scale_from, "%s", said_by(wish->file));
        return;
    }
    char why[160];
    as->scale = guess_unit(scene, as->up == SCENE_UP_Y, why, sizeof why);
    snprintf(as->scale_from, sizeof as->scale_from, "assumed: %s", why[0] != '\0' ? why : "the file doesn't say");
    sh_warn(&app_report_stderr,
            "%s: the file does not give its unit: %s is assumed%s%s, which makes the mesh %.4g m large; --scale sets "
            "another one",
            name, as->scale == 1.0 ? "a metre" : "a millimetre", why[0] != '\0' ? ", since " : "", why,
            as->scale * size);
}

/* Turns the mesh to metres and z up, as loading the configuration will do. */
static void mesh_turn(struct scene *scene, const struct init_mesh *as, double scale)
{
    const int y_up = as->up == SCENE_UP_Y;
    const double low[3] = {scene->min_m[0], scene->min_m[1], scene->min_m[2]}, *high = scene->max_m;
    const double min[3] = {low[0], y_up ? -high[2] : low[1], y_up ? low[1] : low[2]};
    const double max[3] = {high[0], y_up ? -low[2] : high[1], y_up ? high[1] : high[2]};
    for (uint32_t i = 0; i < scene->n_vertices; i++) {
        double *v = scene->vertex_m[i], turned[3] = {v[0], y_up ? -v[2] : v[1], y_up ? v[1] : v[2]};
        for (int k = 0; k < 3; k++)
            v[k] = turned[k] * scale;
    }
    for (int k = 0; k < 3; k++) { /* no -0 */
        scene->min_m[k] = min[k] * scale + 0.0;
        scene->max_m[k] = max[k] * scale + 0.0;
    }
}

/* Whether an error already says what to do, or what is allowed. Errors of rasters get no advice, since nobody exports a
 * raster as a mesh. */
static int has_advice(const char *file, const char *text)
{
    static const char *const words[] = {"export ", "convert ", "copy it", "allowed", "scene.", "join "};
    for (size_t i = 0; i < sizeof words / sizeof words[0]; i++)
        if (strstr(text, words[i]) != NULL) return 1;
    return geotiff_is_name(file);
}

static int mesh_fail(const char *file, const struct sh_err *why, int code, struct sh_err *err)
{
    if (code != SH_EINPUT || has_advice(file, why->text)) return sh_fail(err, code, "%s", why->text);
    return sh_fail(err, code, "%.380s; a mesh of triangles is needed: export it again, for instance as .obj or .ply",
                   why->text);
}

/* A raster's system is kept where the scene can be anchored by it. */
static void find_crs(const struct init_wish *wish, struct init_mesh *mesh)
{
    struct geotiff g;
    struct crs_place at;
    struct sh_err why;
    if (!geotiff_is_name(wish->file) || mesh->up != SCENE_UP_Z || mesh->scale != 1.0) return;
    if (geotiff_read(wish->file, &g, &why) != SH_OK || g.crs[0] == '\0') return;
    if (crs_locate(g.crs, g.easting_m[0], g.northing_m[0], 0.0, &at, &why) == SH_OK)
        snprintf(mesh->crs, sizeof mesh->crs, "%s", g.crs);
}

/* ---- reading */

static void keep_warning(void *ctx, const char *warning)
{
    fprintf(ctx, "%s\n", warning);
}

/* The reader's warnings come again when the configuration is checked. So they are printed here only if reading
 * fails. */
static int read_mesh(const struct scene_mesh_spec *spec, struct scene **scene, struct sh_err *why)
{
    const struct sh_report *all = &app_report_stderr;
    char *warnings = NULL, *rest, *line;
    size_t size;
    FILE *kept = open_memstream(&warnings, &size);
    if (kept == NULL) return sh_fail(why, SH_ENOMEM, "no memory");
    const struct sh_report keep = {.ctx = kept, .warn = keep_warning, .rest = all};
    const int rc = scene_load(spec, 1, INFINITY, &keep, scene, why);
    fclose(kept);
    for (rest = warnings; rc != SH_OK && (line = strsep(&rest, "\n")) != NULL;)
        if (*line != '\0') sh_warn(all, "%s", line);
    free(warnings);
    return rc;
}

/* The mesh is loaded without a tolerance; the check of the configuration loads it with one. */
int init_load_mesh(const struct init_wish *wish, const char *name, struct scene **scene, struct init_mesh *mesh,
                   struct sh_err *err)
{
    const struct scene_mesh_spec spec = {
        .file = wish->file, .up = SCENE_UP_Z, .scale = wish->scale > 0.0 ? wish->scale : 1.0};
    struct sh_err why = {0};
    if (access(wish->file, R_OK) != 0) return sh_fail(err, SH_EINPUT, "%s: %s", wish->file, strerror(errno));
    int rc = read_mesh(&spec, scene, &why);
    if (rc != SH_OK) return mesh_fail(wish->file, &why, rc, err);
    choose_up(wish, name, *scene, mesh);
    choose_scale(wish, name, *scene, mesh);
    find_crs(wish, mesh);
    mesh_turn(*scene, mesh, mesh->scale / spec.scale);
    return SH_OK;
}
