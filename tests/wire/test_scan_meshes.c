/* SPDX-License-Identifier: MIT */
/* Meshes of scans through the real program. A sphere in a closed room is a closed surface in every format, by other
 * people's readers. Points are spread over it. Recordings that give no mesh are refused. */
#include "core/scene.h"
#include "tests/wire/room.h"
#include "tests/wire/usage_rig.h"

enum { RINGS = 19, STEPS = 36, N_VERTICES = 2 + (RINGS - 2) * STEPS, N_FACES = 2 * (RINGS - 2) * STEPS };

static const char SPHERE[] = "head: {profile: sphere, step_deg: 10}\n"
                             "scene:\n  meshes: [{file: room.obj, up: z, scale: 1}]\n"
                             "stations:\n  - {position_m: [0.31, -0.42, 0.17], heading_deg: 30}\n"
                             "  - {position_m: [1.25, 0.5, 0.25]}\n"
                             "output: {layout: polar}\n";

static struct sh_err err;

static void run_well(struct wire *wire, const char *program, const char *const *args)
{
    wire_run_program(wire, program, args, 0);
}

/* Runs `record` on the sphere, with up to twelve more arguments; -o NAME is a file of the folder. */
static void record(struct wire *wire, const char *const *more)
{
    char path[12][128], config[128];
    const char *args[16] = {"record", config, "--quiet"};
    int n = 3;
    room_write(wire);
    snprintf(config, sizeof config, "%s", wire_write_text(wire, "sphere.yaml", SPHERE));
    for (int i = 0; more[i] != NULL; i++) {
        const int is_file = i > 0 && strcmp(more[i - 1], "-o") == 0;
        snprintf(path[i], sizeof path[i], "%s", is_file ? wire_path(wire, more[i]) : more[i]);
        args[n++] = path[i];
    }
    run_well(wire, wire_program(), args);
}

/* ---- a mesh in memory, as a reader has it */

static double vertex[2 * N_FACES][3];
static int corner[2 * N_FACES][3];
static int n_vertices, n_faces;

static int read_numbers(struct wire *wire, const char *name, const char *format, void *to, size_t size)
{
    char *text = wire_read(wire_path(wire, name), NULL), *p = text;
    int n = 0, used = 0;
    for (; n < 2 * N_FACES; n++, p += used) {
        char *row = (char *)to + (size_t)n * 3 * size;
        if (sscanf(p, format, row, row + size, row + 2 * size, &used) != 3) break;
    }
    free(text);
    return n;
}

/* Reads it by Python's struct and the header alone. */
static void read_ply(struct wire *wire, const char *name, int has_faces)
{
    char script[PATH_MAX], in[128], points[128];
    assert_non_null(realpath("tests/readers/ply.py", script));
    snprintf(in, sizeof in, "%s", wire_path(wire, name));
    snprintf(points, sizeof points, "%s", wire_path(wire, "points"));
    const char *const args[] = {script, in, points, has_faces ? wire_path(wire, "faces") : NULL, NULL};
    run_well(wire, "/usr/bin/python3", args);
    n_vertices = read_numbers(wire, "points", "%lf %lf %lf%n", vertex, sizeof vertex[0][0]);
    n_faces = has_faces ? read_numbers(wire, "faces", "%d %d %d%n", corner, sizeof corner[0][0]) : 0;
}

static double area(void)
{
    double sum = 0;
    for (int i = 0; i < n_faces; i++) {
        const double *a = vertex[corner[i][0]], *b = vertex[corner[i][1]], *c = vertex[corner[i][2]];
        double u[3], v[3];
        for (int k = 0; k < 3; k++) {
            u[k] = b[k] - a[k];
            v[k] = c[k] - a[k];
        }
        const double n[3] = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
        sum += 0.5 * sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    }
    return sum;
}

/* Each edge lies in two faces, once in each direction. */
static void assert_closed(void)
{
    static uint8_t seen[N_VERTICES][N_VERTICES]; /* from, to */
    int n_edges = 0;
    memset(seen, 0, sizeof seen);
    for (int i = 0; i < n_faces; i++)
        for (int k = 0; k < 3; k++) {
            const int p = corner[i][k], q = corner[i][(k + 1) % 3];
            assert_true(p >= 0 && p < N_VERTICES && q >= 0 && q < N_VERTICES && p != q);
            assert_int_equal(seen[p][q]++, 0);
            n_edges += p < q;
        }
    for (int p = 0; p < N_VERTICES; p++)
        for (int q = 0; q < N_VERTICES; q++)
            assert_int_equal(seen[p][q], seen[q][p]);
    assert_int_equal(n_vertices - n_edges + n_faces, 2);
}

/* Ranges have steps of a millimetre on the wire at most. Each point is within a millimetre of a wall. */
static void assert_on_walls(void)
{
    for (int i = 0; i < n_vertices; i++) {
        double nearest = 1;
        for (int k = 0; k < 3; k++) {
            assert_true(vertex[i][k] > ROOM_MIN[k] - 1e-3 && vertex[i][k] < ROOM_MAX[k] + 1e-3);
            nearest = fmin(nearest, fmin(vertex[i][k] - ROOM_MIN[k], ROOM_MAX[k] - vertex[i][k]));
        }
        assert_true(nearest < 1e-3);
    }
}

static void a_sphere_in_every_format(void **state)
{
    struct wire *wire = *state;
    static const struct {
        const char *name;
        enum scene_up up;
    } other[] = {{"a.obj", SCENE_UP_Z}, {"a.gltf", SCENE_UP_Y}, {"a.glb", SCENE_UP_Y}, {"a.fbx", SCENE_UP_Z}};
    struct scene *scene;
    record(wire, (const char *[]){"--long-edge", "0", "-o", "a.glb", "-o", "a.fbx", "--colour", "range", NULL});
    record(wire, (const char *[]){"--mesh", "--long-edge", "0", "-o", "a.ply", "-o", "a.obj", "-o", "a.gltf", NULL});
    read_ply(wire, "a.ply", 1);
    assert_int_equal(n_vertices, N_VERTICES);
    assert_int_equal(n_faces, N_FACES);
    assert_closed();
    assert_on_walls();
    for (size_t i = 0; i < sizeof other / sizeof other[0]; i++) {
        const struct scene_mesh_spec spec = {
            .file = wire_path(wire, other[i].name), .scale = 1, .up = other[i].up, .textures = 1};
        if (scene_load(&spec, 1, 1e-3, NULL, &scene, &err) != SH_OK) fail_msg("%s", err.text);
        assert_int_equal(scene->n_triangles, N_FACES);
        assert_int_equal(scene->n_textures, 1);
        double sum = 0;
        for (uint32_t t = 0; t < scene->n_triangles; t++)
            for (int k = 0; k < 3; k++)
                sum += scene->vertex_m[scene->triangle[t][k]][2] - vertex[corner[t][k]][2];
        /* Triangles come in the same order: the mean difference of corners is below a float's step of 6.3 m. */
        assert_true(fabs(sum) / (3 * N_FACES) < 4e-7);
        scene_free(scene);
    }
}

static void points_spread_over_the_sphere(void **state)
{
    struct wire *wire = *state;
    record(wire, (const char *[]){"--mesh", "--long-edge", "0", "-o", "a.ply", NULL});
    read_ply(wire, "a.ply", 1);
    const double expected = round(5 * area());
    record(wire, (const char *[]){"--sparse", "5", "--long-edge", "0", "-o", "b.ply", NULL});
    read_ply(wire, "b.ply", 0);
    assert_true(n_vertices > 1000 && n_vertices == expected);
}

static void each_station_by_itself(void **state)
{
    struct wire *wire = *state;
    static const char *const name[] = {"a-1.obj", "a-1.mtl", "a-1.png", "a-2.obj", "a-2.mtl", "a-2.png"};
    record(wire, (const char *[]){"--station", "all", "--split", "-o", "a.obj", NULL});
    for (size_t i = 0; i < sizeof name / sizeof name[0]; i++)
        assert_int_equal(access(wire_path(wire, name[i]), F_OK), 0);
    char *text = wire_read(wire_path(wire, "a-2.mtl"), NULL);
    assert_non_null(strstr(text, "newmtl station_2\n"));
    assert_non_null(strstr(text, "map_Kd a-2.png\n"));
    free(text);
}

static int is_same(struct wire *wire, const char *name, const char *other)
{
    size_t n, m;
    char *a = wire_read(wire_path(wire, name), &n), *b = wire_read(wire_path(wire, other), &m);
    const int same = n == m && memcmp(a, b, n) == 0;
    free(a);
    free(b);
    return same;
}

/* Beside the mesh of all, each station's mesh still has its image: its colours have limits of its own. */
static void each_station_beside_all(void **state)
{
    struct wire *wire = *state;
    record(wire, (const char *[]){"--station", "all", "--split", "--colour", "range", "-o", "a.obj", NULL});
    record(wire, (const char *[]){"--station", "all", "--each", "--colour", "range", "-o", "b.obj", NULL});
    assert_true(is_same(wire, "a-1.png", "b-1.png"));
    assert_true(is_same(wire, "a-2.png", "b-2.png"));
    assert_false(is_same(wire, "b-1.png", "b.1.png") && is_same(wire, "b-2.png", "b.2.png"));
}

static const char PLANAR[] = "head: {profile: sick-tim571, frames: 1}\n"
                             "scene:\n  meshes: [{file: room.obj, up: z, scale: 1}]\n"
                             "stations: [{position_m: [0, 0, 0]}]\n";
static const char PLACED[] = "head: {profile: full-sweep, frames: 1}\n"
                             "scene:\n  meshes: [{file: room.obj, up: z, scale: 1}]\n"
                             "stations: [{position_m: [0, 0, 0], lat_deg: 48, lon_deg: 11, height_m: 500}]\n";
static const char BEAMS[] = "head: {profile: velodyne-vlp16, frames: 1}\n"
                            "scene:\n  meshes: [{file: room.obj, up: z, scale: 1}]\n"
                            "stations: [{position_m: [0, 0, 0]}]\n";

static void what_is_refused(void **state)
{
    struct wire *wire = *state;
    const struct {
        const char *config, *args[6], *says;
    } row[] = {
        {USAGE_GOOD, {"--mesh", "-o", "a.las"}, "--mesh: no .ply is among the files"},
        {USAGE_GOOD, {"--sparse", "5", "-o", "a.obj"}, "--sparse: no .ply is among the files"},
        {USAGE_GOOD, {"--sparse", "5", "--mesh", "-o", "a.ply"}, "a .ply can be only one of the two"},
        {USAGE_GOOD, {"--mesh", "--ply-columns", "range,time", "-o", "a.ply"}, "allowed are range, reflectance, label"},
        {USAGE_GOOD, {"--mesh", "--empty-shots", "-o", "a.ply"}, "can not hold them"},
        {USAGE_GOOD, {"--sparse", "0", "-o", "a.ply"}, "--sparse 0"},
        {USAGE_GOOD, {"--sparse-seed", "1", "--mesh", "-o", "a.ply"}, "--sparse-seed needs --sparse"},
        {USAGE_GOOD, {"--long-edge", "3", "-o", "a.ply"}, "--long-edge: no mesh is among the files"},
        {USAGE_GOOD, {"--long-edge", "-3", "-o", "a.obj"}, "--long-edge -3"},
        {PLACED, {"--crs", "ecef", "-o", "a.glb"}, "a.glb: .glb holds coordinates as float"},
        {PLACED, {"--crs", "geodetic", "-o", "a.obj"}, "a.obj: this format holds metres"},
        {USAGE_GOOD, {"--each", "-o", "a.ply", "-o", "a-2.ply"}, "the file of one scan of"},
        {USAGE_GOOD, {"--listen", "-o", "a.ply"}, "allowed only with a head on a wire"},
        {PLANAR, {"-o", "a.obj"}, "it neither pans nor moves"},
        {BEAMS, {"--mesh", "-o", "a.ply"}, "this head fires beams in turn"},
    };
    room_write(wire);
    usage_complaints = 0;
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        char config[128], file[6][128];
        const char *args[10] = {"record", config, "--quiet"};
        int n = 3;
        snprintf(config, sizeof config, "%s", wire_write_text(wire, "config.yaml", row[i].config));
        for (int k = 0; k < 6 && row[i].args[k] != NULL; k++) {
            const int is_file = k > 0 && strcmp(row[i].args[k - 1], "-o") == 0;
            if (is_file) snprintf(file[k], sizeof file[k], "%s", wire_path(wire, row[i].args[k]));
            args[n++] = is_file ? file[k] : row[i].args[k];
        }
        usage_expect(wire, row[i].says, args, 2, (const char *const[]){row[i].says, NULL});
    }
    assert_int_equal(usage_complaints, 0);
}

/* The file's chunks are read: images lie within, and numbers begin at multiples of their size, as the format
 * demands. */
static void a_glb_holds_its_images(void **state)
{
    static const char script[] =
        "import json, struct, sys\n"
        "b = open(sys.argv[1], 'rb').read()\n"
        "magic, version, length = struct.unpack('<4sII', b[:12])\n"
        "n, kind = struct.unpack('<I4s', b[12:20])\n"
        "m, binary = struct.unpack('<I4s', b[20 + n:28 + n])\n"
        "assert (magic, version, length, kind, binary) == (b'glTF', 2, len(b), b'JSON', b'BIN\\0'), b[:28]\n"
        "j, data = json.loads(b[20:20 + n]), b[28 + n:28 + n + m]\n"
        "assert all('uri' not in x for x in j['images'] + j['buffers']) and len(j['images']) == 2, j['images']\n"
        "for image in j['images']:\n"
        "    v = j['bufferViews'][image['bufferView']]\n"
        "    png = data[v.get('byteOffset', 0):][:v['byteLength']]\n"
        "    assert image['mimeType'] == 'image/png' and png[:8] == b'\\x89PNG\\r\\n\\x1a\\n', image\n"
        "    assert png[12:16] == b'IHDR' and png.rstrip(b'\\0')[-8:-4] == b'IEND', png[-12:]\n"
        "for a in j['accessors']:\n"
        "    at = a.get('byteOffset', 0) + j['bufferViews'][a['bufferView']].get('byteOffset', 0)\n"
        "    assert at % 4 == 0, (a, at)\n"
        "assert all('baseColorTexture' in x['pbrMetallicRoughness'] for x in j['materials'])\n";
    struct wire *wire = *state;
    char path[96];
    wire_empty(wire);
    record(wire, (const char *[]){"--station", "all", "-o", "a.glb", "--colour", "range", NULL});
    snprintf(path, sizeof path, "%s", wire_path(wire, "a.glb"));
    run_well(wire, "/usr/bin/python3", (const char *const[]){"-c", script, path, NULL});
    assert_int_not_equal(access(wire_path(wire, "a.png"), F_OK), 0);
    assert_int_not_equal(access(wire_path(wire, "a.1.png"), F_OK), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_sphere_in_every_format, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(points_spread_over_the_sphere, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(each_station_by_itself, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(each_station_beside_all, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(what_is_refused, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(a_glb_holds_its_images, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
