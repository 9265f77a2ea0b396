/* SPDX-License-Identifier: MIT */
/* The first ten minutes with a mesh of one's own: `scanhead init`, and its advice where a scan would show little. */
#include "tests/wire/room.h"

static char *out, *text; /* of the last command: standard output and error */

static void forget(void)
{
    free(out);
    free(text);
    out = text = NULL;
}

/* Runs a command in the folder of the test. */
static int run_in(struct wire *wire, const char *folder, const char *const *args)
{
    char here[512];
    assert_non_null(getcwd(here, sizeof here));
    forget();
    char heads[600];
    snprintf(heads, sizeof heads, "%s/config/heads", here);
    setenv("SCANHEAD_HEADS", heads, 1);
    assert_int_equal(chdir(folder), 0);
    char program[1024];
    snprintf(program, sizeof program, "%s%s%s", wire_program()[0] == '/' ? "" : here,
             wire_program()[0] == '/' ? "" : "/", wire_program());
    int status = wire_wait(wire, wire_spawn_program(wire, program, args, "out", "err", -1));
    assert_int_equal(chdir(here), 0);
    out = wire_read(wire_path(wire, "out"), NULL);
    text = wire_read(wire_path(wire, "err"), NULL);
    return status;
}

#define RUN(wire, ...) run_in(wire, (wire)->dir, (const char *const[]){__VA_ARGS__, NULL})

static void contains(const char *in, const char *what)
{
    if (strstr(in, what) == NULL) fail_msg("\"%s\" is missing in:\n%s", what, in);
}

/* Returns the points of a binary PLY, by its header. */
static long points_of(const struct wire *wire, const char *name)
{
    char *ply = wire_read(wire_path(wire, name), NULL);
    const char *n = strstr(ply, "element vertex ");
    assert_non_null(n);
    long points = strtol(n + strlen("element vertex "), NULL, 10);
    free(ply);
    return points;
}

/* A room of 8 x 6 x 3 units whose walls face inward. y is up in it where that is asked for. */
static void write_room(const struct wire *wire, const char *name, double unit, int y_up)
{
    static const char *const faces = "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n";
    char obj[1024];
    size_t used = 0;
    for (int i = 0; i < 8; i++) {
        double x = i & 1 ? 8 : 0, y = i & 2 ? 6 : 0, z = i & 4 ? 3 : 0;
        used += (size_t)snprintf(obj + used, sizeof obj - used, "v %g %g %g\n", unit * x, unit * (y_up ? z : y),
                                 unit * (y_up ? -y : z));
    }
    snprintf(obj + used, sizeof obj - used, "%s", faces);
    wire_write_text(wire, name, obj);
}

/* Only init, check and record are needed. The configuration has a few lines, with comments. */
static void a_mesh_becomes_a_scan(void **state)
{
    struct wire *wire = *state;
    write_room(wire, "room.obj", 1, 0);
    assert_int_equal(RUN(wire, "init", "room.obj"), 0);
    contains(out, "size      8 x 6 x 3 m");
    contains(out, "x 0.000..8.000  y 0.000..6.000  z 0.000..3.000 m");
    contains(out, "inside, 1.6 m above a floor");
    contains(out, "written   room.yaml");
    contains(text, "the file does not give its unit: a metre is assumed, which makes the mesh 8 m large");
    contains(text, "the file does not give the axis that points up: z is assumed");
    char *yaml = wire_read(wire_path(wire, "room.yaml"), NULL);
    contains(yaml, "file: \"room.obj\"");
    contains(yaml, "# inside, 1.6 m above a floor");
    contains(yaml, "assumed: the file doesn't say");
    int lines = 0;
    for (const char *p = yaml; *p != '\0'; p++)
        lines += *p == '\n';
    assert_in_range(lines, 10, 20);
    free(yaml);
    assert_int_equal(RUN(wire, "check", "room.yaml"), 0);
    assert_string_equal(text, "");
    assert_int_equal(RUN(wire, "record", "room.yaml", "-o", "room.ply", "--quiet"), 0);
    assert_true(points_of(wire, "room.ply") > 100000); /* about 200,000; nearly all of a closed room */
    forget();
}

/* Writes a model of Debian's as FBX text, with other axes: pairs of a name and a number. */
static void write_fbx(struct wire *wire, const char *const *axes)
{
    char *all = wire_read("/usr/share/assimp/models/FBX/cubes_with_names.fbx", NULL), from[64];
    for (; axes[0] != NULL; axes += 2) {
        snprintf(from, sizeof from, "P: \"%s\", \"int\", \"Integer\", \"\",", axes[0]);
        char *at = strstr(all, from), *next;
        assert_non_null(at);
        at += strlen(from);
        assert_true(asprintf(&next, "%.*s%s%s", (int)(at - all), all, axes[1], at + strcspn(at, "\r\n")) > 0);
        free(all);
        all = next;
    }
    wire_write_text(wire, "cubes.fbx", all);
    free(all);
}

/* With these axes, up: y and up: z leave the mesh on its side, on its head, or mirrored. No key helps. */
static void axes_that_no_key_can_say(void **state)
{
    struct wire *wire = *state;
    static const struct {
        const char *axes[8], *says, *up;
    } is[] = {
        {{"UpAxis", "1"}, NULL, "up: y # as the file says"},
        {{"UpAxis", "2", "FrontAxis", "1", "FrontAxisSign", "-1"}, NULL, "up: z # as the file says"},
        {{"UpAxisSign", "-1", "FrontAxisSign", "-1"},
         "its -y axis points up, which no key can set: with up: y the mesh is upside down; export it with y or z up",
         "up: y # assumed"},
        {{"UpAxis", "2", "UpAxisSign", "-1", "FrontAxis", "1"},
         "its -z axis points up, which no key can set: with up: z the mesh is upside down; export it with y or z up",
         "up: z # assumed"},
        {{"UpAxis", "0", "CoordAxis", "1", "CoordAxisSign", "-1"},
         "its x axis points up, which no key can set: with up: z the mesh lies on its side; export it with y or z up",
         "up: z # assumed"},
        {{"CoordAxisSign", "-1"},
         "its axes are left-handed, which no key can set: the mesh is mirrored; export it with right-handed axes",
         "up: y # as the file says"},
    };
    if (access("/usr/share/assimp/models/FBX/cubes_with_names.fbx", R_OK) != 0) skip();
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++) {
        write_fbx(wire, is[i].axes);
        unlink(wire_path(wire, "cubes.yaml"));
        assert_int_equal(RUN(wire, "init", "cubes.fbx"), 0);
        if (is[i].says != NULL)
            contains(text, is[i].says);
        else
            assert_true(strstr(text, "axis") == NULL && strstr(text, "handed") == NULL);
        char *yaml = wire_read(wire_path(wire, "cubes.yaml"), NULL);
        contains(yaml, is[i].up);
        free(yaml);
    }
    forget();
}

/* The mesh is in millimetres with y up. Options say so, or its size makes it likely. */
static void unit_and_axes_can_be_given(void **state)
{
    struct wire *wire = *state;
    write_room(wire, "mm.obj", 1000, 1);
    assert_int_equal(RUN(wire, "init", "mm.obj", "--up", "y"), 0);
    contains(text, "the file does not give its unit: a millimetre is assumed, which makes the mesh 8 m large");
    assert_null(strstr(text, "axis"));
    contains(out, "size      8 x 6 x 3 m");
    contains(out, "inside, 1.6 m above a floor");
    assert_int_equal(RUN(wire, "init", "mm.obj", "--up", "y", "--scale", "0.002", "-o", "twice.yaml"), 0);
    assert_string_equal(text, "");
    contains(out, "size      16 x 12 x 6 m");
    contains(out, "unit      0.002 m, given by --scale");
    assert_int_equal(RUN(wire, "check", "twice.yaml"), 0);
    write_room(wire, "nm.obj", 1e9, 0); /* in metres it would be larger than a scene may be */
    assert_int_equal(RUN(wire, "init", "nm.obj"), 2);
    contains(text, "check the scale of 1 metres per unit");
    assert_int_equal(RUN(wire, "init", "nm.obj", "--up", "z", "--scale", "1e-9"), 0);
    contains(out, "size      8 x 6 x 3 m");
    forget();
}

/* A tetrahedron of 8 x 6 x 4 units of half a metre, z up. Its reader makes metres and y up of them, so --scale is a factor
 * of the file's metres. */
static void collada_is_converted(void **state)
{
    struct wire *wire = *state;
    static const char dae[] =
        "<?xml version=\"1.0\"?><COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" version=\"1.4.1\">"
        "<asset><unit meter=\"0.5\"/><up_axis>Z_UP</up_axis></asset>"
        "<library_geometries><geometry id=\"g\"><mesh>"
        "<source id=\"p\"><float_array id=\"a\" count=\"12\">0 0 0 8 0 0 0 6 0 0 0 4</float_array>"
        "<technique_common><accessor source=\"#a\" count=\"4\" stride=\"3\"><param name=\"X\" type=\"float\"/>"
        "<param name=\"Y\" type=\"float\"/><param name=\"Z\" type=\"float\"/></accessor></technique_common></source>"
        "<vertices id=\"v\"><input semantic=\"POSITION\" source=\"#p\"/></vertices>"
        "<triangles count=\"4\"><input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/>"
        "<p>0 2 1 0 1 3 1 2 3 2 0 3</p></triangles></mesh></geometry></library_geometries>"
        "<library_visual_scenes><visual_scene id=\"s\"><node id=\"n\"><instance_geometry url=\"#g\"/></node>"
        "</visual_scene></library_visual_scenes><scene><instance_visual_scene url=\"#s\"/></scene></COLLADA>";
    wire_write_text(wire, "t.dae", dae);
    assert_int_equal(RUN(wire, "init", "t.dae"), 0);
    contains(out, "size      4 x 3 x 2 m");
    contains(out, "unit      1 m, the file is converted to it\naxes      y up, the file is converted to it\n");
    assert_int_equal(RUN(wire, "init", "t.dae", "--scale", "2", "--force"), 0);
    contains(out, "size      8 x 6 x 4 m");
    forget();
}

/* Boxes of 10 m stand a kilometre from each other, in units of a metre from an origin. */
static void write_city(const struct wire *wire, const char *name, double x, double y, double z)
{
    static const char *const faces[] = {"1 2 3 4", "5 8 7 6", "1 5 6 2", "2 6 7 3", "3 7 8 4", "4 8 5 1"};
    char *obj = NULL;
    size_t len;
    FILE *to = open_memstream(&obj, &len);
    for (int i = 0; i < 9; i++) {
        for (int c = 0; c < 8; c++)
            fprintf(to, "v %.3f %.3f %.3f\n", x + 1000 * (i % 3) + 10 * (c % 4 == 1 || c % 4 == 2),
                    y + 1000 * (i / 3) + 10 * (c % 4 >= 2), z + 10 * (c / 4));
        for (int f = 0; f < 6; f++) {
            int v[4];
            assert_int_equal(sscanf(faces[f], "%d %d %d %d", &v[0], &v[1], &v[2], &v[3]), 4);
            fprintf(to, "f %d %d %d %d\n", 8 * i + v[0], 8 * i + v[3], 8 * i + v[2], 8 * i + v[1]);
        }
    }
    assert_int_equal(fclose(to), 0);
    wire_write_text(wire, name, obj);
    free(obj);
}

/* A mesh is larger than 2 km without a unit, so its contents decide. Nobody scans a plate of 2 m by 1 cm, and nobody
 * puts an origin 2.7 km beside it. */
static void the_unit_follows_from_what_there_is(void **state)
{
    struct wire *wire = *state;
    write_city(wire, "city.obj", 2684500, 1246300, 440);
    assert_int_equal(RUN(wire, "init", "city.obj", "--up", "z"), 0);
    contains(text,
             "a metre is assumed, since its coordinates, near 2685505 1247305 445, are those of a projected system");
    contains(out, "size      2010 x 2010 x 10 m");
    contains(out, "unit      1 m, assumed: its coordinates, near ");
    write_city(wire, "here.obj", 0, 0, 0);
    assert_int_equal(RUN(wire, "init", "here.obj", "--up", "z"), 0);
    contains(text, "a metre is assumed, since it is as wide and flat as a survey, and would be a thin plate in "
                   "millimetres");
    contains(out, "size      2010 x 2010 x 10 m");
    write_room(wire, "mm.obj", 1000, 0);
    assert_int_equal(RUN(wire, "init", "mm.obj", "--up", "z"), 0);
    contains(out, "unit      0.001 m, assumed: the file doesn't say");
    forget();
}

/* From outside of all, nothing of nine boxes on two kilometres is seen. So the station stands near one of them. */
static void a_sparse_city_is_looked_at(void **state)
{
    struct wire *wire = *state;
    write_city(wire, "city.obj", 2684500, 1246300, 440);
    assert_int_equal(RUN(wire, "init", "city.obj", "--up", "z"), 0);
    contains(out, "outside, facing the mesh");
    double p[3];
    assert_int_equal(sscanf(strstr(out, "station "), "station %lf %lf %lf m", &p[0], &p[1], &p[2]), 3);
    /* The box in the middle: a sphere of 8.7 m is around it, and the station is 2.5 of its radii away. */
    assert_true(hypot(p[0] - 2685505, p[1] - 1247305) < 25 && p[2] > 440 && p[2] < 470);
    const double seen = 0.01 * atof(strstr(out, "facing the mesh; ") + strlen("facing the mesh; "));
    assert_true(seen > 0.3);
    assert_int_equal(RUN(wire, "record", "city.yaml", "-o", "city.ply", "--quiet"), 0);
    assert_true(points_of(wire, "city.ply") > 10000);
    forget();
}

/* The next command can be pasted into a shell, and an error is one line. */
static void names_may_have_any_bytes(void **state)
{
    struct wire *wire = *state;
    write_room(wire, "it's a r\xc3\xb6\xc3\xb6m.obj", 1, 0);
    assert_int_equal(RUN(wire, "init", "it's a r\xc3\xb6\xc3\xb6m.obj"), 0);
    contains(out, "next: scanhead record 'it'\\''s a r\xc3\xb6\xc3\xb6m.yaml' -o scan.ply\n");
    write_room(wire, "back\\slash and \"quotes\".obj", 1, 0);
    assert_int_equal(RUN(wire, "init", "back\\slash and \"quotes\".obj", "--up", "z", "-o", "marks.yaml"), 0);
    assert_int_equal(RUN(wire, "check", "marks.yaml"), 0);
    write_room(wire, "two\nlines.obj", 1, 0);
    assert_int_equal(RUN(wire, "init", "two\nlines.obj", "--up", "z", "--scale", "1"), 2);
    contains(text, "two?lines.");
    assert_ptr_equal(strchr(text, '\n'), text + strlen(text) - 1);
    forget();
}

/* A closed body is scanned from outside, with a field of view that just holds it. So the station has to look at it. */
static void a_body_is_looked_at(void **state)
{
    struct wire *wire = *state;
    wire_write_text(wire, "box.obj",
                    "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\nv 0 0 1\nv 2 0 1\nv 2 1 1\nv 0 1 1\nf 1 4 3 2\nf 5 6 7 8\n"
                    "f 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n");
    assert_int_equal(RUN(wire, "init", "box.obj", "--up", "z", "--scale", "1"), 0);
    contains(out, "outside, facing the mesh");
    const char *share = strstr(out, "facing the mesh; ");
    assert_non_null(share);
    const double seen = 0.01 * atof(share + strlen("facing the mesh; "));
    assert_int_equal(RUN(wire, "record", "box.yaml", "-o", "box.ply", "--empty-shots", "--quiet"), 0);
    const double shots = (double)points_of(wire, "box.ply");
    assert_int_equal(RUN(wire, "record", "box.yaml", "-o", "box.ply", "--quiet"), 0);
    /* init estimates the view from 1,024 directions or more: within 5 %, three standard errors of a share. */
    assert_true(seen > 0.3 && fabs((double)points_of(wire, "box.ply") / shots - seen) < 0.05);
    forget();
}

/* The call comes from another folder, by a path that leads out of the configuration's folder. */
static void the_path_of_the_mesh_starts_at_the_configuration(void **state)
{
    struct wire *wire = *state;
    write_room(wire, "room.obj", 1, 0);
    assert_int_equal(mkdir(wire_path(wire, "sub"), 0700), 0);
    assert_int_equal(RUN(wire, "init", "room.obj", "-o", "sub/there.yaml"), 0);
    char *yaml = wire_read(wire_path(wire, "sub/there.yaml"), NULL);
    contains(yaml, "file: \"../room.obj\"");
    free(yaml);
    assert_int_equal(RUN(wire, "check", "sub/there.yaml"), 0);
    assert_int_equal(run_in(wire, "/", (const char *const[]){"check", wire_path(wire, "sub/there.yaml"), NULL}), 0);
    unlink(wire_path(wire, "sub/there.yaml"));
    rmdir(wire_path(wire, "sub"));
    forget();
}

static void what_is_there_stays(void **state)
{
    struct wire *wire = *state;
    write_room(wire, "room.obj", 1, 0);
    wire_write_text(wire, "room.yaml", "mine\n");
    assert_int_equal(RUN(wire, "init", "room.obj"), 2);
    contains(text, "room.yaml already exists; give another name with -o, or --force to replace it");
    char *yaml = wire_read(wire_path(wire, "room.yaml"), NULL);
    assert_string_equal(yaml, "mine\n");
    free(yaml);
    assert_int_equal(RUN(wire, "init", "room.obj", "--force"), 0);
    assert_int_equal(RUN(wire, "check", "room.yaml"), 0);
    /* The configuration stays where nothing can be printed, and the command says so. */
    char room[512], other[512];
    snprintf(room, sizeof room, "%s", wire_path(wire, "room.obj"));
    snprintf(other, sizeof other, "%s", wire_path(wire, "other.yaml"));
    const char *const closed[] = {"-c", "exec \"$0\" \"$@\" >&-", wire_program(), "init", room, "-o", other, NULL};
    assert_int_equal(wire_wait(wire, wire_spawn_program(wire, "/bin/sh", closed, "out", "err", -1)), 1);
    forget();
    text = wire_read(wire_path(wire, "err"), NULL);
    contains(text, "scanhead: standard output: Bad file descriptor; ");
    contains(text, "/other.yaml is written\n");
    assert_int_equal(RUN(wire, "check", "other.yaml"), 0);
    forget();
}

static void wrong_use_says_what_is_allowed(void **state)
{
    struct wire *wire = *state;
    write_room(wire, "room.obj", 1, 0);
    wire_write_text(wire, "points.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\np 1 2 3\n");
    assert_int_equal(RUN(wire, "init", "room.obj", "-o", "room.txt"), 2);
    contains(text, "-o room.txt: allowed is a name that ends in .yaml or .yml");
    assert_int_equal(RUN(wire, "init", "room.obj", "--up", "x"), 2);
    contains(text, "--up x: allowed y, z");
    assert_int_equal(RUN(wire, "init", "points.obj"), 2);
    contains(text, "has no triangles");
    contains(text, "export it again");
    wire_write_text(
        wire, "apart.gltf",
        "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0}],"
        "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0}}]}],"
        "\"buffers\":[{\"uri\":\"gone.bin\",\"byteLength\":36}],"
        "\"bufferViews\":[{\"buffer\":0,\"byteLength\":36}],"
        "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"}]}\n");
    assert_int_equal(RUN(wire, "init", "apart.gltf"), 2);
    contains(text, "gone.bin\"; its geometry is in that file, which belongs in the same folder");
    assert_null(strstr(text, "a mesh of triangles is needed")); /* one piece of advice is enough */
    assert_int_equal(RUN(wire, "init", "none.obj"), 2);
    contains(text, "none.obj: No such file or directory");
    assert_int_equal(RUN(wire, "init", "room.obj", "-o", "no/room.yaml"), 2);
    assert_int_equal(RUN(wire, "init", "room.obj", "--scale", "0.000001"), 2); /* 8 um */
    contains(text, "--scale sets metres per unit");
    assert_int_not_equal(access(wire_path(wire, "room.yaml"), F_OK), 0);
    forget();
}

/* The station is 500 m beside a room of 8 m. check, run and record report it. */
static void a_scan_of_nothing_is_told(void **state)
{
    static const char moved[] = "stations.0.position_m=[0, 500, 1]";
    struct wire *wire = *state;
    write_room(wire, "room.obj", 1, 0);
    assert_int_equal(RUN(wire, "init", "room.obj"), 0);
    assert_int_equal(RUN(wire, "check", "room.yaml", "--set", moved), 0);
    contains(text, "no surface within range_max_m, 130 m");
    contains(text, "the scan is mostly empty: of 1024 directions 0 hit something");
    assert_int_equal(RUN(wire, "record", "room.yaml", "--set", moved, "-o", "no.ply", "--quiet"), 0);
    contains(text, "the scan is mostly empty");
    contains(text, "mostly empty: 0 of ");
    assert_int_equal(
        RUN(wire, "run", "room.yaml", "--set", moved, "--pace", "fast", "--start", "--frames", "1", "--quiet"), 0);
    contains(text, "the scan is mostly empty");
    contains(text, "mostly empty: 0 of ");
    forget();
}

static void a_colour_that_nothing_fills_is_told(void **state)
{
    struct wire *wire = *state;
    write_room(wire, "room.obj", 1, 0);
    assert_int_equal(RUN(wire, "init", "room.obj"), 0);
    assert_int_equal(RUN(wire, "record", "room.yaml", "-o", "grey.ply", "--colour", "reflectance", "--quiet"), 0);
    contains(text, "--colour reflectance: none of ");
    contains(text, "it needs the head's signal.model: on");
    assert_int_equal(RUN(wire, "record", "room.yaml", "-o", "grey.ply", "--colour", "reflectance", "--quiet", "--set",
                         "signal.model=on", "--set", "surfaces.0.reflectance=0.5"),
                     0);
    assert_string_equal(text, "");
    forget();
}

static void a_map_is_an_image(void **state)
{
    struct wire *wire = *state;
    write_room(wire, "room.obj", 1, 0);
    assert_int_equal(RUN(wire, "init", "room.obj"), 0);
    assert_int_equal(RUN(wire, "map", "room.yaml", "-o", "x.jpg"), 2);
    contains(text, "-o x.jpg: allowed are names that end in .png or .svg");
    assert_int_not_equal(access(wire_path(wire, "x.jpg"), F_OK), 0);
    forget();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_mesh_becomes_a_scan, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(unit_and_axes_can_be_given, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(the_unit_follows_from_what_there_is, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(a_sparse_city_is_looked_at, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(axes_that_no_key_can_say, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(names_may_have_any_bytes, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(a_body_is_looked_at, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(the_path_of_the_mesh_starts_at_the_configuration, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(collada_is_converted, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(what_is_there_stays, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(wrong_use_says_what_is_allowed, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(a_scan_of_nothing_is_told, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(a_colour_that_nothing_fills_is_told, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(a_map_is_an_image, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
