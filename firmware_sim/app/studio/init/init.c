/* SPDX-License-Identifier: MIT */
/* scanhead init: a first configuration for a mesh. */
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/angle.h"
#include "core/newfile.h"
#include "core/utf8.h"
#include "firmware_sim/app/app.h"
#include "firmware_sim/app/studio/init/mesh.h"
#include "firmware_sim/app/studio/init/text.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/limits.h"
#include "firmware_sim/config/load.h"
#include "firmware_sim/config/profile.h"
#include "firmware_sim/site/site.h"

/* The head for rooms sees up to the ceiling; the other one sees farther. */
static const char *const ROOM_PROFILE = "leica-rtc360", *const PROFILE = "riegl-vz600i";

struct init_run {
    struct app_input in;
    struct init_wish wish;
    const char *output;
    int force;
    char default_output[CONFIG_PATH_LEN], name[128]; /* of the configuration; of the mesh, as shown */
    char path[CONFIG_PATH_LEN];                      /* of the mesh, as the configuration names it */
    struct init_mesh as;
};

/* ---- place */

static int find_place(const struct init_run *run, const struct scene *scene, struct config_profile *profile,
                      struct viewpoint *at, struct sh_err *err)
{
    int rc = config_load_profile(PROFILE, run->output, profile, err);
    if (rc != SH_OK) return rc;
    const struct viewpoint_view view = {profile->range_min_m, profile->range_max_m,
                                        angle_rad(1e-6 * (double)profile->fov_min_udeg),
                                        angle_rad(1e-6 * (double)profile->fov_max_udeg)};
    rc = viewpoint_find(scene, &view, &app_report_stderr, at, err);
    if (rc == SH_OK && at->seen == 0.0)
        rc = sh_fail(
            err, SH_EINPUT,
            "%s: no place was found from which a head with ranges of %g to %g m hits anything: the mesh is %.3g m "
            "large; --scale sets metres per unit, now %g",
            run->name, profile->range_min_m, profile->range_max_m, init_largest_m(scene), run->as.scale);
    if (rc != SH_OK || at->kind != VIEWPOINT_INSIDE) return rc;
    struct config_profile room;
    rc = config_load_profile(ROOM_PROFILE, run->output, &room, err);
    if (rc == SH_OK && init_largest_m(scene) <= room.range_max_m) *profile = room;
    return rc;
}

/* ---- the file */

/* Finds the mesh's path from the configuration's folder; where the two share only the root, its absolute path. */
static int find_path(const struct init_run *run, char path[CONFIG_PATH_LEN], struct sh_err *err)
{
    char folder[CONFIG_PATH_LEN], mesh[PATH_MAX], from[PATH_MAX];
    snprintf(folder, sizeof folder, "%.*s.", (int)(basename(run->output) - run->output), run->output);
    if (realpath(run->wish.file, mesh) == NULL)
        return sh_fail(err, SH_EINPUT, "%s: %s", run->wish.file, strerror(errno));
    if (realpath(folder, from) == NULL) return sh_fail(err, SH_EINPUT, "%s: %s", run->output, strerror(errno));
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

/* Checks what the configuration will have: the folders above it may have any names. A key that names a file takes no
 * control characters. */
static int check_path(const struct init_run *run, struct sh_err *err)
{
    if (!utf8_is_valid(run->path))
        return sh_fail(err, SH_EINPUT, "%s: its path is not UTF-8, so YAML can't name it; allowed is UTF-8: rename it",
                       run->name);
    for (const char *p = run->path; *p != '\0'; p++)
        if ((unsigned char)*p < 0x20 || *p == 0x7f)
            return sh_fail(err, SH_EINPUT, "%s: its path has control characters, so no key can name it: rename it",
                           run->name);
    return SH_OK;
}

static int write_draft(const char *path, const char *draft, const struct init_text *text, int *fd, struct sh_err *err)
{
    int rc = newfile_part(path, draft, fd, err);
    if (rc != SH_OK) return rc;
    FILE *out = newfile_stream(*fd, "w");
    if (out != NULL) init_write_text(text, out);
    int failed = out == NULL || ferror(out);
    if (out != NULL) failed |= fclose(out) != 0;
    if (failed) rc = sh_fail(err, SH_EIO, "%s: %s", path, strerror(errno));
    if (rc != SH_OK) newfile_drop(draft, *fd);
    return rc;
}

/* Loads the draft as any command would. */
static int check_draft(const struct init_run *run, const char *draft, struct sh_err *err)
{
    struct config *cfg = calloc(1, sizeof *cfg);
    struct site *site = NULL;
    int rc = cfg != NULL ? config_load(draft, NULL, 0, cfg, err) : sh_fail(err, SH_ENOMEM, "no memory");
    if (rc == SH_OK) {
        snprintf(cfg->file, sizeof cfg->file, "%s", run->output); /* for messages */
        rc = site_load(cfg, &app_report_stderr, &site, err);
    }
    site_free(site);
    free(cfg);
    return rc;
}

static int write_checked(const struct init_run *run, const struct init_text *text, struct sh_err *err)
{
    char draft[CONFIG_PATH_LEN];
    int fd;
    snprintf(draft, sizeof draft, "%s.part", run->output);
    int rc = write_draft(run->output, draft, text, &fd, err);
    if (rc != SH_OK) return rc;
    rc = check_draft(run, draft, err);
    if (rc == SH_OK) return newfile_keep(run->output, draft, fd, err);
    newfile_drop(draft, fd);
    return rc;
}

/* Prints a path with the quotes that a shell needs to take it for one operand. */
static void put_operand(const char *path)
{
    static const char plain[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_./+-";
    if (path[0] == '-') fputs("./", stdout);
    if (path[strspn(path, plain)] == '\0') {
        fputs(path, stdout);
        return;
    }
    putchar('\'');
    for (const char *p = path; *p != '\0'; p++)
        fputs(*p == '\'' ? "'\\''" : (const char[2]){*p}, stdout);
    putchar('\'');
}

/* The file stays where this can't be printed, and a second call needs --force. So the error says so. */
static int say_result(const struct init_run *run, const struct scene *s, const struct viewpoint *at, struct sh_err *err)
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
    printf("station   %.4f %.4f %.4f m, %s; %.0f %% of the view hits something\n", p[0], p[1], p[2], where,
           100.0 * at->seen);
    if (at->faces_out)
        puts("          there is room inside, but its faces point outward: it is treated as a closed body");
    printf("written   %s; next: scanhead record ", run->output);
    put_operand(run->output);
    puts(" -o scan.ply");
    const char *why = app_write_failure(stdout);
    return why == NULL ? SH_OK : sh_fail(err, SH_EIO, "standard output: %s; %s is written", why, run->output);
}

static int write_config(struct init_run *run, const struct scene *scene, struct sh_err *err)
{
    char link[64];
    const char *base = basename(run->output);
    struct config_profile profile;
    struct viewpoint at;
    int stem = (int)(strrchr(base, '.') - base);
    int rc = find_place(run, scene, &profile, &at, err);
    if (rc != SH_OK) return rc;
    snprintf(link, sizeof link, "%.*s.tty", stem, base);
    struct init_text text = {.mesh_name = run->name,
                             .mesh_path = run->path,
                             .link_name = stem + 5 <= (int)sizeof link ? link : NULL,
                             .scene = scene,
                             .mesh = &run->as,
                             .profile = &profile,
                             .at = &at};
    init_choose_scan(&profile, &at, &text.scan);
    rc = write_checked(run, &text, err);
    return rc == SH_OK ? say_result(run, scene, &at, err) : rc;
}

/* ---- the command */

/* The default for house.ifc is house.yaml in the working directory. */
static int choose_output(struct init_run *run)
{
    const char *base = basename(run->wish.file), *dot = strrchr(base, '.');
    int stem = dot != NULL && dot != base ? (int)(dot - base) : (int)strlen(base);
    snprintf(run->name, sizeof run->name, "%s", base);
    sh_keep_line(run->name);
    if (run->output == NULL) {
        snprintf(run->default_output, sizeof run->default_output, "%.*s.yaml", stem, base);
        run->output = run->default_output;
        const struct app_file file = {.option = "output", .path = run->output, .use = APP_WRITES};
        if (app_add_file(&run->in, &file) != APP_OK) return APP_USAGE;
    }
    if (strlen(run->output) > CONFIG_PATH_LEN - 8)
        return app_usage(&app_init, "-o: the path is too long; allowed up to %d bytes", CONFIG_PATH_LEN - 8);
    if (app_ends_in(run->output, ".yaml") || app_ends_in(run->output, ".yml")) return APP_GO_ON;
    return app_usage(&app_init, "-o %s: allowed is a name that ends in .yaml or .yml", run->output);
}

static int init(struct init_run *run, struct sh_err *err)
{
    struct scene *scene = NULL;
    if (!run->force && faccessat(AT_FDCWD, run->output, F_OK, AT_SYMLINK_NOFOLLOW) == 0)
        return sh_fail(err, SH_EINPUT, "%s already exists; give another name with -o, or --force to replace it",
                       run->output);
    int rc = app_check_files(&run->in, NULL, err);
    if (rc == SH_OK) rc = find_path(run, run->path, err);
    if (rc == SH_OK) rc = check_path(run, err);
    if (rc == SH_OK) rc = init_load_mesh(&run->wish, run->name, &scene, &run->as, err);
    if (rc == SH_OK) rc = write_config(run, scene, err);
    scene_free(scene);
    return rc;
}

static int init_run_command(int argc, char **argv)
{
    struct sh_err err = {0};
    struct init_run run = {0};
    int status = app_parse(&app_init, argc, argv, &run.in, &run);
    if (status == APP_GO_ON) {
        run.wish.file = run.in.operand[0];
        status = choose_output(&run);
    }
    if (status != APP_GO_ON) return status;
    if (run.wish.up != NULL && strcmp(run.wish.up, "y") != 0 && strcmp(run.wish.up, "z") != 0)
        return app_usage(&app_init, "--up %s: allowed y, z", run.wish.up);
    app_catch_signals();
    return init(&run, &err) == SH_OK ? APP_OK : app_fail(&err);
}

#define AT(member) offsetof(struct init_run, member)

/* clang-format off */
static const struct app_option OPTIONS[] = {
    {APP_TEXT, "output", "FILE.yaml", .letter = 'o', .at = AT(output), .file = APP_WRITES,
     .help = "file to write; default: the mesh's name, with .yaml, in the working directory"},
    {APP_FLAG, "force", NULL, .at = AT(force), .help = "replace FILE.yaml if it exists"},
    {APP_TEXT, "up", "y|z", .at = AT(wish.up), .help = "the axis that points up, in place of the one in the file"},
    {APP_NUMBER, "scale", "M", .min = 1e-9, .max = 1e9, .at = AT(wish.scale),
     .help = "metres per unit, in place of the value in the file; for Collada and IFC a factor of the file's metres"},
    OPTION_END
};
/* clang-format on */

const struct app_command app_init = {
    .name = "init",
    .operand = {"MESH"},
    .summary = "write a first configuration for a mesh",
    .options = OPTIONS,
    .notes =
        "MESH is a file .obj .ply .stl .gltf .glb .fbx .dae .ifc .tif. Its unit and axes come from the format where\n"
        "that defines them (glTF, GeoTIFF), or from the file (FBX). Collada and IFC have units and axes of their own,\n"
        "which are converted to metres and y up as the file is read. Else metres and z up are assumed, or\n"
        "millimetres where the mesh would be larger than 2 km; a warning says so. Metres are assumed, too, for\n"
        "coordinates of a projected system (large compared with the mesh), and for a mesh that would be a thin plate\n"
        "in millimetres.\n"
        "\n"
        "The station is put above a floor inside, or on open ground, or outside facing the mesh: where most rays over\n"
        "the view of the head hit the mesh. The configuration has comments; change the values that don't fit.\n",
    .run = init_run_command,
};
