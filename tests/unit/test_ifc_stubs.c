/* SPDX-License-Identifier: MIT */
/* IFC where a reader fails, waits for ever or isn't there: one-line programs take the place of the two readers, and
 * their failures are reported. The tests that need node are skipped where it is not installed. */
#include <math.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <time.h>

#include "core/import/ifc/ifc_read.h"
#include "tests/common/thorough.h"
#include "tests/unit/ifc_files.h"
#include "tests/unit/scene_files.h"

static char text[IFC_TEXT_ROOM];
static struct scene *scene;
static struct sh_err err;
static struct scene_import_limits limits;

static int read_text(double tolerance_m)
{
    const struct scene_mesh_spec spec = {
        .file = write_text("a.ifc", text), .up = SCENE_UP_Y, .scale = 1, .limits = &limits};
    const int rc = load_spec(&spec, tolerance_m, &scene, &err);
    unlink(path);
    return rc;
}

static void must_read(double tolerance_m)
{
    if (read_text(tolerance_m) != SH_OK) fail_msg("%s", err.text);
}

static void stub(const char *name, const char *program)
{
    char file[192];
    snprintf(file, sizeof file, "%s/%s", folder, name);
    FILE *f = fopen(file, "w");
    assert_non_null(f);
    fputs(program, f);
    assert_int_equal(fclose(f), 0);
}

static const char *const stub_folders[] = {"node_modules", "node_modules/web-ifc", "node_modules/@ifc-lite",
                                           "node_modules/@ifc-lite/wasm"};
static const char *const stub_files[] = {"node_modules/web-ifc/package.json",
                                         "node_modules/@ifc-lite/wasm/package.json", "web_ifc.mjs", "ifc_lite.mjs"};

static void make_stubs(const char *web, const char *lite)
{
    for (size_t i = 0; i < 4; i++) {
        char file[192];
        snprintf(file, sizeof file, "%s/%s", folder, stub_folders[i]);
        mkdir(file, 0700);
    }
    stub(stub_files[0], "{}");
    stub(stub_files[1], "{}");
    stub(stub_files[2], web);
    stub(stub_files[3], lite);
    limits = scene_import_defaults;
    limits.ifc_folder = folder;
}

static int remove_all(void **state)
{
    char file[192];
    for (size_t i = 0; i < 4; i++) {
        snprintf(file, sizeof file, "%s/%s", folder, stub_files[i]);
        unlink(file);
    }
    for (size_t i = 4; i-- > 0;) {
        snprintf(file, sizeof file, "%s/%s", folder, stub_folders[i]);
        rmdir(file);
    }
    return remove_folder(state);
}

/* One triangle as product 1000. */
#define ONE                                                                                                         \
    "import fs from 'node:fs'\nconst w = a => fs.writeSync(3, new Uint8Array(a.buffer))\n"                          \
    "w(new Uint8Array(Buffer.from('shifc01\\0')))\nw(new Uint32Array([1000, 1, 0, 1]))\n"                           \
    "w(new Uint8Array([10, 0, 0, 0, 0, 0, 0, 0]))\nw(new Uint32Array([3, 1]))\nw(new Float32Array([1, 1, 1, 1]))\n" \
    "w(new Float64Array([1]))\nw(new Float64Array([0, 0, 0, 1, 0, 0, 0, 1, 0]))\nw(new Uint32Array([0, 1, 2, 0]))\n"
#define END "w(new Uint32Array([0, 0, 0, 0]))\n"

static void needs_node(void)
{
    char why[256];
    limits = scene_import_defaults;
    if (!ifc_readers_are_there(&limits, why, sizeof why) && strstr(why, "node") == why) skip();
}

static double seconds(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void one_reader_may_fail(void **state)
{
    (void)state;
    static const struct {
        const char *program, *said;
    } broken[] = {{"process.abort()", "web-ifc crashed while it read the file (SIGABRT)"},
                  {"process.exit(3)", "ended without a message (exit status 3)"},
                  {ONE, "its result is inconsistent"}, /* no end: it may be cut off */
                  {"import fs from 'node:fs'\nfs.writeSync(3, 'nothing of this kind')", "no head"}};
    needs_node();
    ifc_write_text(text, "IFC4", NULL, NULL, ifc_shapes, 1, NULL);
    for (size_t i = SANITIZED ? 2 : 0; i < sizeof broken / sizeof broken[0]; i++) {
        make_stubs(broken[i].program, ONE END);
        must_read(1e-3);
        if (strstr(warnings, "not cross-checked: web-ifc gave no answer") == NULL ||
            strstr(warnings, broken[i].said) == NULL)
            fail_msg("%s", warnings);
        assert_int_equal(scene->n_triangles, 1);
        scene_free(scene);
        limits.ifc_strict = 1;
        assert_int_equal(read_text(1e-3), SH_EINPUT);
        make_stubs(broken[i].program, broken[i].program);
        assert_int_equal(read_text(1e-3), SH_EINPUT);
        if (strstr(err.text, "no reader can read it") == NULL || strchr(err.text, '\n') != NULL ||
            strstr(strstr(err.text, "a.ifc") + 1, "a.ifc") != NULL || strstr(err.text, "ifc-lite") == NULL ||
            strcmp(err.text + strlen(err.text) - 7, "or .ply") != 0)
            fail_msg("%s", err.text);
    }
}

/* Descriptor 5 has the file's size, and a line for each change: here the list of representations of a wall that also
 * has a clearance. */
static void readers_get_the_changes(void **state)
{
    (void)state;
    static const char *const rows[] = {"([0-9]+)\\n$", "([0-9]+)\\n[0-9]+ 11 #1001\\n$"};
    static const char more[] = "#7000=IFCSHAPEREPRESENTATION(#13,'Clearance','SolidModel',(#1060));\n"
                               "#7001=IFCPRODUCTDEFINITIONSHAPE($,$,(#7000,#1001));\n"
                               "#7002=IFCWALL('guid_of_wall',#5,'wall',$,$,#1003,#7001,$,$);\n";
    needs_node();
    for (int i = 0; i < 2; i++) {
        char program[2048];
        snprintf(program, sizeof program,
                 ONE END "const is = /^%s/.exec(fs.readFileSync(5, 'latin1'))\n"
                         "if (!is || Number(is[1]) !== fs.statSync(process.argv[2]).size) process.exit(3)\n",
                 rows[i]);
        ifc_write_text(text, "IFC4", NULL, NULL, ifc_shapes, 1, i == 1 ? more : NULL);
        make_stubs(program, program);
        must_read(1e-3);
        assert_null(strstr(warnings, "not cross-checked"));
        scene_free(scene);
    }
}

/* result.mjs writes a shorter text into its place, so it needs no second copy of the file; a longer one moves the rest.
 * The list of #7001 has one element less, and the face set needs a record more. */
static void changes_reach_the_text(void **state)
{
    (void)state;
    needs_node();
    char program[4096], *module = realpath("core/import/ifc/result.mjs", NULL);
    assert_non_null(module);
    static const char *const more[] = {
        "#7000=IFCSHAPEREPRESENTATION(#13,'Clearance','SolidModel',(#1060));\n"
        "#7001=IFCPRODUCTDEFINITIONSHAPE($,$,(#7000,#1001));\n"
        "#7002=IFCWALL('guid_of_wall',#5,'wall',$,$,#1003,#7001,$,$);\n",
        "#7000=IFCCARTESIANPOINTLIST3D(((1.,0.,0.),(2.,0.,0.)));\n"
        "#7001=IFCTRIANGULATEDFACESET(#7000,$,.F.,((1,1,1)),(2));\n#7002=IFCDIRECTION((1.,0.,0.));\n"};
    static const char *const left[] = {
        "#7001=IFCPRODUCTDEFINITIONSHAPE\\(\\$,\\$,\\(#1001 {6}\\)\\);\\n#7002=",
        "\\n#7003=IFCCARTESIANPOINTLIST3D\\(\\(\\(2.,0.,0.\\)\\)\\);#7001=IFCTRIANGULATEDFACESET\\(#7003,\\$,.F.,"
        "\\(\\(1,1,1\\)\\),\\$  \\);\\n#7002=IFCDIRECTION\\(\\(1.,0.,0.\\)\\);\\nENDSEC;\\nEND-ISO-10303-21;\\n$"};
    for (int i = 0; i < 2; i++) {
        snprintf(program, sizeof program,
                 ONE END "const { load } = await import('%s')\nconst bytes = load(process.argv[2])\n"
                         "const same = bytes.length === fs.statSync(process.argv[2]).size\n"
                         "if (same !== %s || !/%s/.test(Buffer.from(bytes).toString('latin1'))) process.exit(3)\n",
                 module, i == 0 ? "true" : "false", left[i]);
        ifc_write_text(text, "IFC4", NULL, NULL, ifc_shapes, 1, more[i]);
        make_stubs(program, program);
        must_read(1e-3);
        if (strstr(warnings, "not cross-checked") != NULL) fail_msg("%d: %s", i, warnings);
        scene_free(scene);
    }
    free(module);
}

/* Under `ulimit -v` the file may be a good one, so no advice is to export it again. No process reaches this limit. */
static void limit_of_addresses_is_named(void **state)
{
    (void)state;
    struct rlimit was, limit;
    needs_node();
    assert_int_equal(getrlimit(RLIMIT_AS, &was), 0);
    if (was.rlim_max != RLIM_INFINITY) skip();
    limit = (struct rlimit){.rlim_cur = (rlim_t)1 << 52, .rlim_max = was.rlim_max};
    ifc_write_text(text, "IFC4", NULL, NULL, ifc_shapes, 1, NULL);
    make_stubs("process.exit(3)", "process.exit(3)");
    assert_int_equal(setrlimit(RLIMIT_AS, &limit), 0);
    const int rc = read_text(1e-3);
    assert_int_equal(setrlimit(RLIMIT_AS, &was), 0);
    assert_int_equal(rc, SH_EINPUT);
    const char *last = strstr(err.text, "ifc-lite ended without a message; `ulimit -v` leaves it 4294967296 MiB");
    if (last == NULL || strstr(err.text, "export") != NULL) fail_msg("%s", err.text);
    assert_string_equal(err.text + strlen(err.text) - 40, " lift that limit; the file may be broken");
}

/* A product's object is its type, name and GlobalId, in up to 255 bytes. "IFCBUILDINGELEMENTPROXY_" and
 * "_guid_of_product__00000" take 47, so the name has 208. A longer one is cut between two letters, and counted. */
static void long_names_are_cut_between_letters(void **state)
{
    (void)state;
    enum { LETTERS = 104 };
    needs_node();
    make_stubs(ONE END, ONE END);
    for (int more = 0; more < 2; more++) {
        char name[2048] = "", want[SCENE_NAME_LEN + 1] = "IFCBUILDINGELEMENTPROXY_";
        struct ifc_shape wall = ifc_shapes[0];
        strcat(name, more ? "a" : "");
        strcat(want, more ? "a" : "");
        for (int i = 0; i < LETTERS; i++) {
            strcat(name, "\\X2\\00FC\\X0\\");
            if (!more || i < LETTERS - 1) strcat(want, "\xc3\xbc");
        }
        strcat(want, "_guid_of_product__00000");
        wall.name = name;
        ifc_write_text(text, "IFC4", NULL, NULL, &wall, 1, NULL);
        must_read(1e-3);
        assert_string_equal(scene->surface[0].object, want);
        assert_int_equal(scene->counts.names_cut, more);
        assert_int_equal(strstr(warnings, "cut") != NULL, more);
        scene_free(scene);
    }
}

/* Both readers assume metres. */
static void missing_unit_is_said(void **state)
{
    (void)state;
    needs_node();
    ifc_write_text(text, "IFC4", "IFCSIUNIT(*,.AREAUNIT.,$,.SQUARE_METRE.)", NULL, ifc_shapes, 1, NULL);
    make_stubs(ONE END, ONE END);
    must_read(1e-3);
    if (strstr(warnings, "IFCUNITASSIGNMENT #8: no unit of length; readers mostly take metres then") == NULL)
        fail_msg("%s", warnings);
    scene_free(scene);
    limits.ifc_strict = 1;
    assert_int_equal(read_text(1e-3), SH_EINPUT);
    assert_non_null(strstr(err.text, "no unit of length; scene.ifc_strict demands a unit"));
}

/* ifc-lite has levels of facets, but no tolerance. */
static void facets_of_ifc_lite_are_said(void **state)
{
    (void)state;
    static const struct ifc_shape round[1] = {
        {"round", "@50", "50=IFCEXTRUDEDAREASOLID(@51,#12,#10,1.)\n51=IFCCIRCLEPROFILEDEF(.AREA.,$,#17,0.75)", 0, 0,
         0.75}};
    needs_node();
    for (int curved = 0; curved < 2; curved++) {
        ifc_write_text(text, "IFC4", NULL, NULL, curved ? round : ifc_shapes, 1, NULL);
        make_stubs("process.exit(3)", ONE END);
        must_read(1e-3);
        assert_int_equal(
            strstr(warnings,
                   "1 product: curved, with the body of ifc-lite, whose facets don't keep scene.tolerance_m: IFC") !=
                NULL,
            curved);
        scene_free(scene);
    }
}

/* web-ifc never ends by itself on some broken files. web-ifc is ended 10 s after the other reader has ended, or with
 * the limit. */
static void reader_that_hangs_is_ended(void **state)
{
    (void)state;
    if (SANITIZED) return; /* it waits for 11 s */
    needs_node();
    ifc_write_text(text, "IFC4", NULL, NULL, ifc_shapes, 1, NULL);
    make_stubs("setInterval(() => 0, 1e6)", ONE END);
    limits.time_s = 2000; /* beyond the test's own limit: the other reader's end has to end it */
    must_read(1e-3);
    if (strstr(warnings, "web-ifc did not read it within") == NULL || strstr(warnings, "scene.import_s") != NULL)
        fail_msg("%s", warnings); /* a longer limit would not help */
    scene_free(scene);
    make_stubs("setInterval(() => 0, 1e6)", "setInterval(() => 0, 1e6)");
    limits.time_s = 1;
    const double start = seconds();
    assert_int_equal(read_text(1e-3), SH_EINPUT);
    assert_true(seconds() - start >= 1.0);
    if (strstr(err.text, "did not read it within 1 s") == NULL) fail_msg("%s", err.text);
}

static void assimp_gets_bodies_alone(void)
{
    /* A profile is no body. Assimp by itself takes the first. */
    ifc_write_text(text, "IFC2X3", NULL, NULL, ifc_shapes, 1,
                   "#7000=IFCEXTRUDEDAREASOLID(#7001,#12,#10,9.);\n#7001=IFCRECTANGLEPROFILEDEF(.AREA.,$,#17,9.,9.);\n"
                   "#7002=IFCSHAPEREPRESENTATION(#13,'Profile','SolidModel',(#7000));\n"
                   "#7003=IFCPRODUCTDEFINITIONSHAPE($,$,(#7002,#1001));\n"
                   "#7004=IFCWALL('guid_of_wall_000000000',#5,'wall',$,$,#1003,#7003,$);\n"
                   "#7005=IFCRELCONTAINEDINSPATIALSTRUCTURE('guid_of_relation_00009',#5,$,$,(#7004),#20);\n");
    must_read(1e-3);
    if (!(fabs(total_area(scene) - 2 * 28) < 1e-4)) fail_msg("%g m2", total_area(scene));
    scene_free(scene);
    /* Members of an analysis model share a wall's shape, and a product has only a clearance. */
    ifc_write_text(
        text, "IFC2X3", NULL, NULL, ifc_shapes, 1,
        "#7000=IFCSTRUCTURALSURFACEMEMBER('guid_of_plate_00000000',#5,'plate',$,$,#1003,#1002,.SHELL.,0.2);\n"
        "#7001=IFCSHAPEREPRESENTATION(#13,'Clearance','SolidModel',(#1060));\n"
        "#7002=IFCPRODUCTDEFINITIONSHAPE($,$,(#7001));\n"
        "#7003=IFCWALL('guid_of_space_00000000',#5,'space',$,$,#1003,#7002,$);\n"
        "#7005=IFCRELCONTAINEDINSPATIALSTRUCTURE('guid_of_relation_00009',#5,$,$,(#7000,#7003),#20);\n");
    must_read(1e-3);
    if (!(fabs(total_area(scene) - 28) < 1e-4)) fail_msg("%g m2", total_area(scene));
    if (strstr(warnings, "part of an analysis model") == NULL || strstr(warnings, "'space' guid_of_space") == NULL)
        fail_msg("%s", warnings);
    scene_free(scene);
}

/* Without node Assimp reads the file. Assimp's mistakes are errors, unless Assimp was asked for. */
static void without_node_assimp_reads(void **state)
{
    (void)state;
    char *had = strdup(getenv("PATH"));
    setenv("PATH", folder, 1);
    limits = scene_import_defaults;
    ifc_write_text(text, "IFC2X3", NULL, NULL, ifc_shapes, 1, NULL);
    must_read(1e-3);
    if (strstr(warnings, "node is not installed: Assimp reads it") == NULL) fail_msg("%s", warnings);
    assert_true(fabs(total_area(scene) - 28) < 1e-4);
    scene_free(scene);
    ifc_write_text(text, "IFC2X3", NULL, NULL, &ifc_shapes[6], 1, NULL);
    assert_int_equal(read_text(1e-3), SH_EINPUT);
    if (strstr(err.text, "IFCBOOLEANCLIPPINGRESULT") == NULL || strstr(err.text, "guid_of_product__00000") == NULL)
        fail_msg("%s", err.text);
    limits.ifc_reader = IFC_READER_ASSIMP;
    must_read(1e-3);
    if (strstr(warnings, "'half space, far' guid_of_product__00000") == NULL) fail_msg("%s", warnings);
    scene_free(scene);
    assimp_gets_bodies_alone();
    limits.ifc_reader = IFC_READER_WEB;
    assert_int_equal(read_text(1e-3), SH_EINPUT);
    setenv("PATH", had, 1);
    free(had);
}
int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_reader_may_fail),         cmocka_unit_test(missing_unit_is_said),
        cmocka_unit_test(facets_of_ifc_lite_are_said), cmocka_unit_test(reader_that_hangs_is_ended),
        cmocka_unit_test(without_node_assimp_reads),   cmocka_unit_test(long_names_are_cut_between_letters),
        cmocka_unit_test(readers_get_the_changes),     cmocka_unit_test(changes_reach_the_text),
        cmocka_unit_test(limit_of_addresses_is_named),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_all);
}
