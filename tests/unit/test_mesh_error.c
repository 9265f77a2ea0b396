/* SPDX-License-Identifier: MIT */
/* These are tests of the error of single precision in a mesh. Errors that the format makes are allowed, reported, and
 * planned with. */
#include "tests/common/collada.h"
#include "tests/unit/scene_files.h"

#include <math.h>

#include "firmware_sim/config/config.h"
#include "firmware_sim/config/load.h"
#include "firmware_sim/site/site.h"

/* A hall of 30 m: the error of its farthest coordinate is 31 * 6e-8 = 1.86e-6 m, printed with two digits. */
static const char HALL[] = COLLADA_TRIANGLE("-1 -1 0 31 -1 0 0 31 0");

static int remove_files(void **state)
{
    static const char *const file[] = {"hall.dae", "hall.ply", "m.dae", "run.yaml"};
    char name[160];
    for (size_t i = 0; i < sizeof file / sizeof *file; i++) {
        snprintf(name, sizeof name, "%s/%s", folder, file[i]);
        unlink(name);
    }
    return remove_folder(state);
}

static enum site_purpose purpose = SITE_FOR_SCANS;

static int load_hall(const char *mesh, const char *tolerance, const char *more, struct config *cfg, struct site **site,
                     struct sh_err *err)
{
    char text[1024];
    const struct sh_report report = {.warn = keep_warning};
    snprintf(text, sizeof text,
             "head: {profile: riegl-vz400i}\nscene:\n%s  meshes:\n    - {file: %s, up: z, scale: 1}\n"
             "stations:\n  - {position_m: [1, 1, 2]}\noutput: {crs: local}\n%s",
             tolerance, mesh, more);
    write_text("run.yaml", text);
    n_warnings = 0;
    warnings[0] = '\0';
    int rc = config_load(path, NULL, 0, cfg, err);
    return rc == SH_OK ? site_load_for(cfg, purpose, NULL, &report, site, err) : rc;
}

/* Returns the one row of a stage. */
static const struct plan_row *row_of(const char *stage, const struct site *site)
{
    const struct plan_row *found = NULL;
    for (size_t i = 0; i < site->plan.n; i++) {
        if (strcmp(site->plan.row[i].stage, stage) != 0) continue;
        if (found != NULL) fail_msg("two rows of %s", stage);
        found = &site->plan.row[i];
    }
    if (found == NULL) fail_msg("no row of %s", stage);
    return found;
}

static void check_accepted(const char *mesh, const char *tolerance, const char *more)
{
    static struct config cfg;
    struct site *site;
    struct sh_err err;
    if (load_hall(mesh, tolerance, more, &cfg, &site, &err) != SH_OK) fail_msg("%s", err.text);
    if (strstr(warnings, "read in single precision, with errors up to 1.9e-06 m: coordinates go up to 31\n") == NULL)
        fail_msg("warnings: %s", warnings);
    assert_true(fabs(site->scene->error_m - 1.9e-6) < 1e-12);
    if (purpose == SITE_FOR_PLAN) {
        const struct plan_row *row = row_of("mesh", site);
        assert_string_equal(row->method, "single precision");
        assert_true(row->error_m == site->scene->error_m);
    }
    site_free(site);
}

static void as_much_as_the_format_holds_is_allowed(void **state)
{
    (void)state;
    write_text("hall.dae", HALL);
    purpose = SITE_FOR_PLAN;
    check_accepted("hall.dae", "", "");
    purpose = SITE_FOR_SCANS;
    check_accepted("hall.dae", "", "plan: {tolerance_m: 2e-5}\n");
    check_accepted("hall.dae", "  tolerance_m: 2e-6\n", "plan: {tolerance_m: 1e-6}\n");
}

/* The default is a tenth of the plan's tolerance, where that is given. The figure that the refusal names is enough. */
static void a_refusal_names_key_and_figure(void **state)
{
    (void)state;
    static struct config cfg;
    struct site *site;
    struct sh_err err;
    write_text("hall.dae", HALL);
    assert_int_equal(load_hall("hall.dae", "", "plan: {tolerance_m: 1e-5}\n", &cfg, &site, &err), SH_EINPUT);
    static const char want[] = "errors up to 1.9e-06 m; allowed are 1e-06 m (scene.tolerance_m, or else a tenth of "
                               "plan.tolerance_m): set it to 1.9e-06, move";
    if (strstr(err.text, want) == NULL) fail_msg("%s", err.text);
    check_accepted("hall.dae", "  tolerance_m: 1.9e-6\n", "plan: {tolerance_m: 1e-5}\n");
}

/* Float columns of a binary PLY: the reader is exact, but the writer was not. */
static void float_columns_of_ply_are_told(void **state)
{
    (void)state;
    static const char head[] = "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\n"
                               "property float y\nproperty float z\nelement face 1\n"
                               "property list uchar int vertex_indices\nend_header\n";
    static const float v[9] = {-1, -1, 0, 31, -1, 0, 0, 31, 0};
    static const uint8_t face[13] = {3, 0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0};
    char ply[sizeof head - 1 + sizeof v + sizeof face];
    memcpy(ply, head, sizeof head - 1);
    memcpy(ply + sizeof head - 1, v, sizeof v);
    memcpy(ply + sizeof head - 1 + sizeof v, face, sizeof face);
    write_file("hall.ply", ply, sizeof ply);
    check_accepted("hall.ply", "", "");
    check_accepted("hall.ply", "  tolerance_m: 1e-9\n", ""); /* what the writer has rounded is never refused */
    static const float small[9] = {-0.25f, -0.25f, 0, 0.5f, -0.25f, 0, 0, 0.5f, 0};
    memcpy(ply + sizeof head - 1, small, sizeof small);
    const struct scene_mesh_spec spec = {.file = write_file("hall.ply", ply, sizeof ply), .scale = 1};
    struct scene *s;
    struct sh_err err;
    if (load_spec(&spec, 1e-3, &s, &err) != SH_OK) fail_msg("%s", err.text);
    assert_true(s->error_m >= 0.5 * 0x1p-24 && s->error_m < 0.55 * 6e-8); /* two digits, rounded up */
    scene_free(s);
}

/* A millimetre shows in a scan, so the warning gives the remedy. */
static void a_coarse_mesh_is_to_be_moved(void **state)
{
    (void)state;
    static const struct {
        const char *file, *x;
        int coarse;
    } at[] = {{"hall.dae", "5000", 0}, {"hall.dae", "391437", 1}};
    for (int i = 0; i < 2; i++) {
        char text[2048];
        struct scene *scene;
        struct sh_err err;
        snprintf(text, sizeof text, COLLADA_TRIANGLE("%s 0 0 %s 9 0 0 9 0"), at[i].x, at[i].x);
        const struct scene_mesh_spec spec = {.file = write_text(at[i].file, text), .scale = 1};
        if (load_spec(&spec, 1.0, &scene, &err) != SH_OK) fail_msg("%s", err.text);
        assert_non_null(strstr(warnings, "single precision")); /* beside what Assimp says of the file */
        assert_int_equal(strstr(warnings, "export it again") != NULL, at[i].coarse);
        scene_free(scene);
    }
}

/* Corners at 0 and 1 are made 100 times larger and then 100 times smaller. In units of 6e-8 the corner's error is 1.
 * Times 100 it is 100, and rounding adds 100. Times 0.01 it is 2, and rounding adds 1. So the error is 3, though the
 * corner was at 100 on the way. */
static void an_error_is_scaled_as_the_mesh_is(void **state)
{
    (void)state;
    static const char dae[] =
        "<?xml version=\"1.0\"?><COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" version=\"1.4.1\">"
        "<asset><unit meter=\"1\"/><up_axis>Y_UP</up_axis></asset><library_geometries><geometry id=\"g\"><mesh>"
        "<source id=\"p\"><float_array id=\"pa\" count=\"9\">0 0 0 1 0 0 0 1 0</float_array><technique_common>"
        "<accessor source=\"#pa\" count=\"3\" stride=\"3\"><param name=\"X\" type=\"float\"/>"
        "<param name=\"Y\" type=\"float\"/><param name=\"Z\" type=\"float\"/></accessor></technique_common></source>"
        "<vertices id=\"v\"><input semantic=\"POSITION\" source=\"#p\"/></vertices><triangles count=\"1\">"
        "<input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/><p>0 1 2</p></triangles></mesh></geometry>"
        "</library_geometries><library_visual_scenes><visual_scene id=\"s\"><node id=\"o\"><scale>0.01 0.01 0.01</scale>"
        "<node id=\"n\"><scale>100 100 100</scale><instance_geometry url=\"#g\"/></node></node></visual_scene>"
        "</library_visual_scenes><scene><instance_visual_scene url=\"#s\"/></scene></COLLADA>";
    struct scene *scene;
    struct sh_err err;
    const struct scene_mesh_spec spec = {.file = write_text("m.dae", dae), .scale = 1};
    if (load_spec(&spec, 1e-6, &scene, &err) != SH_OK) fail_msg("%s", err.text);
    assert_null(strstr(warnings, "single precision"));
    assert_true(fabs(scene->error_m - 1.8e-7) < 1e-12);
    scene_free(scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(as_much_as_the_format_holds_is_allowed), cmocka_unit_test(a_refusal_names_key_and_figure),
        cmocka_unit_test(an_error_is_scaled_as_the_mesh_is), cmocka_unit_test(float_columns_of_ply_are_told),
        cmocka_unit_test(a_coarse_mesh_is_to_be_moved)};
    return cmocka_run_group_tests(tests, make_folder, remove_files);
}
