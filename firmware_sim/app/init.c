/* scanhead init: a first configuration for a mesh. */
#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/angle.h"
#include "core/text.h"
#include "firmware_sim/app/app.h"
#include "firmware_sim/app/init_text.h"
#include "firmware_sim/site/site.h"

/* The head for rooms sees up to the ceiling; the other one sees farther. */
static const char *const ROOM_PROFILE = "leica-rtc360", *const PROFILE = "riegl-vz600i";

/* Larger than this in metres, a mesh without a unit is taken to be in millimetres. */
static const double LARGEST_M = 2000.0;

struct init_run {
    struct app_input in;
    const char *mesh, *output, *up; /* up: "y", "z"; NULL: not given */
    double scale;                   /* 0: not given */
    int force;
    char default_output[CONFIG_PATH_LEN], name[128]; /* of the configuration; of the mesh, as shown */
    char draft[CONFIG_PATH_LEN];                     /* beside it, until it is checked */
    struct init_mesh as;
};

static const char *base_of(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash != NULL ? slash + 1 : path;
}

static int ends_in(const char *text, const char *ending)
{
    size_t n = strlen(text), m = strlen(ending);
    return n > m && strcasecmp(text + n - m, ending) == 0;
}

/* ---- unit and axes */

static double largest_size(const struct scene *scene)
{
    double size = 0.0;
    for (int i = 0; i < 3; i++)
        size = fmax(size, scene->max_m[i] - scene->min_m[i]);
    return size;
}

static const char *said_by(const struct init_run *run)
{
    return ends_in(run->mesh, ".fbx") ? "as the file says" : "as the format defines it";
}

static void choose_up(struct init_run *run, const struct scene *scene)
{
    const int says = scene->says.up;
    const char *from = "given by --up";
    int y_up = says == 2 || says == -2;
    if (run->up != NULL)
        y_up = strcmp(run->up, "y") == 0;
    else if (says == 2 || says == 3)
        from = said_by(run);
    else
        from = says == 0 ? "assumed: the file doesn't say; y is up in many a file" : "assumed";
    run->as.up = y_up ? SCENE_UP_Y : SCENE_UP_Z;
    snprintf(run->as.up_from, sizeof run->as.up_from, "%s", from);
    if (run->up != NULL || says == 2 || says == 3) return;
    if (says == 0)
        sh_warn(&app_report_stderr,
                "%s: which axis points up is not in the file: z is assumed; if the mesh lies on "
                "its side, --up y",
                run->name);
    else
        sh_warn(&app_report_stderr, "%s: its %s%c axis points up, which no key can say: %c is assumed (--up y, --up z)",
                run->name, says < 0 ? "-" : "", "xyz"[abs(says) - 1], y_up ? 'y' : 'z');
}

static void choose_scale(struct init_run *run, const struct scene *scene)
{
    struct init_mesh *as = &run->as;
    const double size = largest_size(scene);
    as->scale = run->scale;
    snprintf(as->scale_from, sizeof as->scale_from, "given by --scale");
    if (run->scale > 0.0) return;
    if (scene->says.unit_m > 0.0) {
        as->scale = scene->says.unit_m;
        snprintf(as->scale_from, sizeof as->scale_from, "%s", said_by(run));
        return;
    }
    as->scale = size > LARGEST_M ? 0.001 : 1.0;
    snprintf(as->scale_from, sizeof as->scale_from, "assumed: the file doesn't say");
    sh_warn(&app_report_stderr,
            "%s: its unit is not in the file: %s is assumed, which makes the mesh %.4g m large; "
            "--scale sets another one",
            run->name, as->scale == 1.0 ? "a metre" : "a millimetre", as->scale * size);
}

/* To metres, z up: what the configuration will do. */
static void turn(struct scene *scene, const struct init_mesh *as)
{
    const int y_up = as->up == SCENE_UP_Y;
    const double low[3] = {scene->min_m[0], scene->min_m[1], scene->min_m[2]}, *high = scene->max_m;
    const double min[3] = {low[0], y_up ? -high[2] : low[1], y_up ? low[1] : low[2]};
    const double max[3] = {high[0], y_up ? -low[2] : high[1], y_up ? high[1] : high[2]};
    for (uint32_t i = 0; i < scene->n_vertices; i++) {
        double *v = scene->vertex_m[i], turned[3] = {v[0], y_up ? -v[2] : v[1], y_up ? v[1] : v[2]};
        for (int k = 0; k < 3; k++)
            v[k] = turned[k] * as->scale;
    }
    for (int k = 0; k < 3; k++) {
        scene->min_m[k] = min[k] * as->scale;
        scene->max_m[k] = max[k] * as->scale;
    }
}

/* Without tolerance and warnings: both come when the configuration is checked. */
static int load_mesh(struct init_run *run, struct scene **scene, struct sh_err *err)
{
    const struct sh_report progress = {NULL, NULL, app_report_stderr.progress};
    const struct scene_mesh_spec spec = {.file = run->mesh, .up = SCENE_UP_Z, .scale = 1.0};
    int rc = scene_load(&spec, 1, INFINITY, &progress, scene, err);
    if (rc != SH_OK) return rc;
    choose_up(run, *scene);
    choose_scale(run, *scene);
    turn(*scene, &run->as);
    return SH_OK;
}

/* ---- place */

static int find_place(const struct init_run *run, const struct scene *scene, struct config_profile *profile,
                      struct standpoint *at, struct sh_err *err)
{
    int rc = config_load_profile(PROFILE, run->output, profile, err);
    if (rc != SH_OK) return rc;
    const struct standpoint_view view = {profile->range_min_m, profile->range_max_m,
                                         angle_rad(1e-6 * (double)profile->fov_min_udeg),
                                         angle_rad(1e-6 * (double)profile->fov_max_udeg)};
    rc = standpoint_find(scene, &view, at, err);
    if (rc == SH_OK && at->seen == 0.0)
        rc = sh_fail(err, SH_EINPUT,
                     "%s: no place was found from where a head that sees %g to %g m meets anything: the mesh is %.3g m "
                     "large; --scale sets metres per unit, now %g",
                     run->name, profile->range_min_m, profile->range_max_m, largest_size(scene), run->as.scale);
    if (rc != SH_OK || at->kind != STANDPOINT_INSIDE) return rc;
    struct config_profile room;
    rc = config_load_profile(ROOM_PROFILE, run->output, &room, err);
    if (rc == SH_OK && largest_size(scene) <= room.range_max_m) *profile = room;
    return rc;
}

/* ---- the file */

/* The mesh as seen from the configuration's folder; where they have nothing in common, from the root. */
static int find_path(const struct init_run *run, char path[CONFIG_PATH_LEN], struct sh_err *err)
{
    char folder[CONFIG_PATH_LEN], mesh[PATH_MAX], from[PATH_MAX];
    snprintf(folder, sizeof folder, "%s", run->output);
    if (realpath(run->mesh, mesh) == NULL) return sh_fail(err, SH_EINPUT, "%s: %s", run->mesh, strerror(errno));
    if (realpath(dirname(folder), from) == NULL) return sh_fail(err, SH_EINPUT, "%s: %s", folder, strerror(errno));
    size_t same = 0, used = 0;
    for (size_t i = 0; mesh[i] == from[i] || (from[i] == '\0' && mesh[i] == '/'); i++) {
        if (mesh[i] == '/') same = i;
        if (from[i] == '\0') break;
    }
    path[0] = '\0';
    for (const char *p = from + same; same > 0 && (p = strchr(p, '/')) != NULL && used + 4 < CONFIG_PATH_LEN; p++)
        used += (size_t)snprintf(path + used, CONFIG_PATH_LEN - used, "../");
    int n = snprintf(path + used, CONFIG_PATH_LEN - used, "%s", mesh + (same > 0 ? same + 1 : 0));
    if (n < 0 || used + (size_t)n >= CONFIG_PATH_LEN)
        return sh_fail(err, SH_EINPUT, "%s: its path is too long; allowed up to %d bytes", run->name,
                       CONFIG_PATH_LEN - 1);
    return SH_OK;
}

static int write_draft(struct init_run *run, const struct init_text *text, struct sh_err *err)
{
    snprintf(run->draft, sizeof run->draft, "%s.XXXXXX", run->output);
    int fd = mkstemp(run->draft);
    FILE *out = fd >= 0 ? fdopen(fd, "w") : NULL;
    if (fd < 0) run->draft[0] = '\0';
    if (out == NULL) return sh_fail(err, SH_EIO, "%s: %s", run->output, strerror(errno));
    mode_t mask = umask(0);
    umask(mask);
    fchmod(fd, 0666 & ~mask);
    init_write_text(text, out);
    int failed = ferror(out);
    failed |= fclose(out) != 0;
    return failed ? sh_fail(err, SH_EIO, "%s: %s", run->output, strerror(errno)) : SH_OK;
}

/* The draft as any command would take it. */
static int check_draft(const struct init_run *run, struct sh_err *err)
{
    struct config *cfg = calloc(1, sizeof *cfg);
    struct site *site = NULL;
    int rc = cfg != NULL ? config_load(run->draft, NULL, 0, cfg, err) : sh_fail(err, SH_ENOMEM, "no memory");
    if (rc == SH_OK) {
        snprintf(cfg->file, sizeof cfg->file, "%s", run->output); /* for messages */
        rc = site_load(cfg, &app_report_stderr, &site, err);
    }
    site_free(site);
    free(cfg);
    return rc;
}

static int refuse_to_overwrite(const struct init_run *run, struct sh_err *err)
{
    return sh_fail(err, SH_EINPUT, "%s is there already; give another name with -o, or --force to replace it",
                   run->output);
}

static int put_in_place(struct init_run *run, struct sh_err *err)
{
    /* Not every file system knows how not to replace; there the look at the beginning has to do. */
    int rc = renameat2(AT_FDCWD, run->draft, AT_FDCWD, run->output, run->force ? 0 : RENAME_NOREPLACE);
    if (rc != 0 && errno == EINVAL) rc = rename(run->draft, run->output);
    if (rc != 0 && errno == EEXIST) return refuse_to_overwrite(run, err);
    if (rc != 0) return sh_fail(err, SH_EIO, "%s: %s", run->output, strerror(errno));
    run->draft[0] = '\0';
    return SH_OK;
}

static void say_result(const struct init_run *run, const struct scene *s, const struct standpoint *at)
{
    char where[128];
    const double *p = at->position_m;
    init_describe(at, where, sizeof where);
    printf("scene     %u triangles, %u surfaces, x %.3f..%.3f  y %.3f..%.3f  z %.3f..%.3f m\n", s->n_triangles,
           s->n_surfaces, s->min_m[0], s->max_m[0], s->min_m[1], s->max_m[1], s->min_m[2], s->max_m[2]);
    printf("size      %.4g x %.4g x %.4g m\n", s->max_m[0] - s->min_m[0], s->max_m[1] - s->min_m[1],
           s->max_m[2] - s->min_m[2]);
    printf("unit      %.7g m, %s\n", run->as.scale, run->as.scale_from);
    printf("axes      %c up, %s\n", run->as.up == SCENE_UP_Y ? 'y' : 'z', run->as.up_from);
    printf("station   %.4f %.4f %.4f m, %s; %.0f %% of the view meets something\n", p[0], p[1], p[2], where,
           100.0 * at->seen);
    if (at->faces_out) puts("          there is room inside, but its faces point outward: taken as a closed body");
    printf("written   %s\n", run->output);
}

static int write_config(struct init_run *run, const struct scene *scene, struct sh_err *err)
{
    char path[CONFIG_PATH_LEN], link[64];
    const char *base = base_of(run->output);
    struct config_profile profile;
    struct standpoint at;
    int stem = (int)(strrchr(base, '.') - base);
    int rc = find_place(run, scene, &profile, &at, err);
    if (rc == SH_OK) rc = find_path(run, path, err);
    if (rc != SH_OK) return rc;
    snprintf(link, sizeof link, "%.*s.tty", stem, base);
    struct init_text text = {.mesh_name = run->name,
                             .mesh_path = path,
                             .link_name = stem + 5 <= (int)sizeof link ? link : NULL,
                             .scene = scene,
                             .mesh = &run->as,
                             .profile = &profile,
                             .at = &at};
    init_choose_scan(&profile, &at, &text.scan);
    rc = write_draft(run, &text, err);
    if (rc == SH_OK) rc = check_draft(run, err);
    if (rc == SH_OK) rc = put_in_place(run, err);
    if (rc == SH_OK) say_result(run, scene, &at);
    if (run->draft[0] != '\0') unlink(run->draft);
    return rc;
}

/* ---- the command */

/* house.ifc becomes house.yaml, here. */
static int choose_output(struct init_run *run)
{
    const char *base = base_of(run->mesh), *dot = strrchr(base, '.');
    int stem = dot != NULL && dot != base ? (int)(dot - base) : (int)strlen(base);
    snprintf(run->name, sizeof run->name, "%s", base);
    text_keep_line(run->name);
    if (run->output == NULL) {
        snprintf(run->default_output, sizeof run->default_output, "%.*s.yaml", stem, base);
        run->output = run->default_output;
    }
    if (strlen(run->output) + 8 > sizeof run->draft)
        return app_usage(&app_init, "-o: the path is too long; allowed up to %zu bytes", sizeof run->draft - 8);
    if (ends_in(run->output, ".yaml") || ends_in(run->output, ".yml")) return APP_GO_ON;
    return app_usage(&app_init, "-o %s: allowed is a name that ends in .yaml or .yml", run->output);
}

static int init(struct init_run *run, struct sh_err *err)
{
    struct scene *scene = NULL;
    if (!run->force && faccessat(AT_FDCWD, run->output, F_OK, AT_SYMLINK_NOFOLLOW) == 0)
        return refuse_to_overwrite(run, err);
    int rc = load_mesh(run, &scene, err);
    if (rc == SH_OK) rc = write_config(run, scene, err);
    scene_free(scene);
    return rc;
}

static int run(int argc, char **argv)
{
    struct sh_err err = {0};
    struct init_run run = {0};
    int status = app_parse(&app_init, argc, argv, &run.in, &run);
    if (status == APP_GO_ON) {
        run.mesh = run.in.operand[0];
        status = choose_output(&run);
    }
    if (status != APP_GO_ON) return status;
    if (run.up != NULL && strcmp(run.up, "y") != 0 && strcmp(run.up, "z") != 0)
        return app_usage(&app_init, "--up %s: allowed y, z", run.up);
    return init(&run, &err) == SH_OK ? APP_OK : app_fail(&err);
}

#define AT(member) offsetof(struct init_run, member)

/* clang-format off */
static const struct app_option OPTIONS[] = {
    {APP_TEXT, "output", "FILE.yaml", .letter = 'o', .at = AT(output),
     .help = "where to write; default: the mesh's name, with .yaml, in the working directory"},
    {APP_FLAG, "force", NULL, .at = AT(force), .help = "replace FILE.yaml where it is there already"},
    {APP_TEXT, "up", "y|z", .at = AT(up), .help = "the axis that points up, in place of what the file says"},
    {APP_NUMBER, "scale", "M", .min = 1e-9, .max = 1e9, .at = AT(scale),
     .help = "metres per unit, in place of what the file says"},
    OPTION_END
};
/* clang-format on */

const struct app_command app_init = {
    .name = "init",
    .operand = {"MESH"},
    .summary = "write a first configuration for a mesh",
    .options = OPTIONS,
    .notes =
        "MESH is a file .obj .ply .stl .gltf .glb .fbx .dae .ifc. Its unit and axes are taken where the format\n"
        "defines them (glTF, Collada, IFC) or the file says them (FBX). Else metres and z up are assumed, or\n"
        "millimetres where the mesh would be larger than 2 km; a warning says so.\n"
        "\n"
        "The station is put above a floor inside, or on open ground, or outside with the mesh before it: where\n"
        "rays cast over the view of the head meet most. The configuration has comments; change what doesn't fit.\n",
    .run = run,
};
