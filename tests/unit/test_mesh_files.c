/* SPDX-License-Identifier: MIT */
/* Meshes are written, and read back by readers that share nothing with the writers: our own of .obj and .ply, Assimp's
 * of .gltf, .glb and .fbx. */
#include <fcntl.h>
#include <math.h>
#include <sys/stat.h>

#include "core/studio/mesh.h"
#include "core/studio/picture.h"
#include "tests/unit/scene_files.h"

/* A sheet of four triangles in two parts. The sheet's coordinates all differ, so that a swapped axis shows. They are
 * multiples of 1/64, which float holds exactly. */
enum { N_VERTICES = 7, N_FACES = 4 };
static const double xyz[N_VERTICES][3] = {{1, 2, 3},       {2.5, 2.125, 3.25}, {2.75, 4, 3.5}, {1.25, 4.5, 3.75},
                                          {-7, 0.5, 1.75}, {-6, 0.75, 2},      {-6.5, 2, 9}};
static const uint32_t face[N_FACES][3] = {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {6, 5, 4}};
static const float normal[N_VERTICES][3] = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}, {0, 0, 1},
                                            {1, 0, 0}, {1, 0, 0}, {0, 1, 0}};
static const float uv[N_VERTICES][2] = {{0.125f, 0.25f}, {0.5f, 0},  {1, 1}, {0, 0.75f},
                                        {0.25f, 0.5f},   {1.25f, 0}, {0, 1}};
static const uint8_t rgb[N_VERTICES][3] = {{255, 0, 0}, {1, 2, 3}, {4, 5, 6}, {7, 8, 9},
                                           {0, 0, 255}, {9, 9, 9}, {0, 1, 0}};
static const uint8_t face_rgb[N_FACES][3] = {{10, 20, 30}, {40, 50, 60}, {70, 80, 90}, {255, 254, 253}};
static const struct mesh_part parts[2] = {{"station 1", 4, 2, "one.png", NULL}, {"station 2", 3, 2, "two.png", NULL}};

static struct sh_err err;

static struct mesh sheet(void)
{
    return (struct mesh){.n_vertices = N_VERTICES,
                         .n_faces = N_FACES,
                         .xyz_m = xyz,
                         .normal = normal,
                         .uv = uv,
                         .face = face,
                         .part = parts,
                         .n_parts = 2};
}

static void drop(const char *name)
{
    assert_int_equal(unlink(path_in(name)), 0);
}

static void write_ok(const char *name, const struct mesh *mesh)
{
    if (mesh_write(path_in(name), mesh, NULL, &err) != SH_OK) fail_msg("%s", err.text);
}

/* A refused mesh leaves no file. */
static void write_refused(const char *name, const struct mesh *mesh, const char *expected)
{
    char part[160];
    snprintf(part, sizeof part, "%s.part", path_in(name));
    assert_int_equal(mesh_write(path_in(name), mesh, NULL, &err), SH_EINPUT);
    if (strstr(err.text, expected) == NULL || strchr(err.text, '\n') != NULL) fail_msg("%s", err.text);
    assert_int_equal(access(path_in(name), F_OK), -1);
    assert_int_equal(access(part, F_OK), -1);
}

static char *read_text(const char *name, size_t *len)
{
    FILE *in = fopen(path_in(name), "rb");
    assert_non_null(in);
    char *text = calloc(1, 1 << 16);
    assert_non_null(text);
    *len = fread(text, 1, (1 << 16) - 1, in);
    fclose(in);
    return text;
}

static void write_image(const char *name)
{
    const uint8_t grey[3] = {9, 9, 9};
    struct picture image;
    assert_int_equal(picture_make(&image, 2, 2, grey, &err), SH_OK);
    assert_int_equal(picture_write_png(&image, "test", path_in(name), &err), SH_OK);
    picture_free(&image);
}

/* Triangle i of the scene is a face of the sheet, beginning at any corner, with its texture coordinates. */
static void assert_triangle(const struct scene *s, uint32_t i, unsigned found[N_FACES])
{
    for (uint32_t f = 0; f < N_FACES; f++)
        for (int turn = 0; turn < 3; turn++) {
            int same = 1;
            for (int k = 0; k < 3 && same; k++) {
                const uint32_t v = face[f][(k + turn) % 3];
                same = memcmp(s->vertex_m[s->triangle[i][k]], xyz[v], sizeof xyz[v]) == 0 &&
                       (s->uv == NULL || memcmp(s->uv[i][k], uv[v], sizeof uv[v]) == 0);
            }
            found[f] += (unsigned)same;
            if (same) return;
        }
    fail_msg("triangle %u is none of those that were written", i);
}

static void read_back(const char *name, enum scene_up up, int has_parts)
{
    struct scene *s;
    unsigned found[N_FACES] = {0};
    const struct scene_mesh_spec spec = {.file = path_in(name), .scale = 1, .up = up, .textures = has_parts};
    if (load_spec(&spec, 1e-3, &s, &err) != SH_OK) fail_msg("%s", err.text);
    assert_int_equal(s->n_triangles, N_FACES);
    for (uint32_t i = 0; i < s->n_triangles; i++)
        assert_triangle(s, i, found);
    for (int f = 0; f < N_FACES; f++)
        assert_int_equal(found[f], 1);
    if (has_parts) {
        assert_non_null(s->uv);
        assert_int_equal(s->n_surfaces, 2);
        assert_int_equal(s->n_textures, 2);
        for (uint32_t i = 0; i < 2; i++) {
            assert_string_equal(s->surface[i].object, parts[i].name);
            assert_non_null(strstr(s->texture[s->surface[i].texture - 1].file, parts[i].texture));
        }
    }
    if (strstr(name, ".fbx") != NULL) {
        assert_true(s->says.unit_m == 1);
        assert_int_equal(s->says.up, 3);
    }
    scene_free(s);
}

static void each_format_is_read_back(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        enum scene_up up;
        const char *beside;
    } format[] = {{"a.obj", SCENE_UP_Z, "a.mtl"},
                  {"a.gltf", SCENE_UP_Y, "a.bin"},
                  {"a.glb", SCENE_UP_Y, NULL},
                  {"a.fbx", SCENE_UP_Z, NULL},
                  {"a.FBX", SCENE_UP_Z, NULL}};
    const struct mesh mesh = sheet();
    write_image("one.png");
    write_image("two.png");
    for (size_t i = 0; i < sizeof format / sizeof format[0]; i++) {
        write_ok(format[i].name, &mesh);
        read_back(format[i].name, format[i].up, 1);
        drop(format[i].name);
        if (format[i].beside != NULL) drop(format[i].beside);
    }
    drop("one.png");
    drop("two.png");
    for (int ascii = 0; ascii < 2; ascii++) {
        struct mesh plain = sheet();
        plain.ascii = ascii;
        write_ok("a.ply", &plain);
        read_back("a.ply", SCENE_UP_Z, 0);
        drop("a.ply");
    }
}

/* Every character of the text is worked out from the format's rules. */
static void ply_as_text(void **state)
{
    (void)state;
    static const double place[3][3] = {{0, -0.5, 1e-9}, {123456.789, 8999999.123456789, -4e-10}, {1e7, 10, 0.1}};
    static const uint32_t one[1][3] = {{2, 0, 1}};
    static const double range[3] = {1.5, (double)NAN, INFINITY};
    static const uint16_t label[3] = {0, 65535, 7};
    const struct mesh_scalar scalar[2] = {{"range", range, MESH_DOUBLE}, {"label", label, MESH_UINT16}};
    static const char *const comment[2] = {"first", "two\nlines"};
    const struct mesh mesh = {.n_vertices = 3,
                              .n_faces = 1,
                              .xyz_m = place,
                              .rgb = rgb,
                              .face = one,
                              .face_rgb = face_rgb,
                              .scalar = scalar,
                              .n_scalars = 2,
                              .comment = comment,
                              .n_comments = 2,
                              .ascii = 1};
    size_t len;
    write_ok("a.ply", &mesh);
    char *text = read_text("a.ply", &len);
    assert_string_equal(text, "ply\nformat ascii 1.0\ncomment first\ncomment two?lines\nelement vertex 3\n"
                              "property double x\nproperty double y\nproperty double z\n"
                              "property uchar red\nproperty uchar green\nproperty uchar blue\n"
                              "property double range\nproperty ushort label\n"
                              "element face 1\nproperty list uchar int vertex_indices\n"
                              "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n"
                              "0 -0.5 0.000000001 255 0 0 1.5 0\n"
                              "123456.789 8999999.123456789 0 1 2 3 nan 65535\n"
                              "10000000 10 0.1 4 5 6 inf 7\n"
                              "3 2 0 1 10 20 30\n");
    free(text);
    drop("a.ply");
}

static void points_alone(void **state)
{
    (void)state;
    const struct mesh mesh = {.n_vertices = 2, .xyz_m = xyz, .rgb = rgb};
    size_t len;
    write_ok("a.obj", &mesh);
    char *text = read_text("a.obj", &len);
    assert_string_equal(text, "o a\nv 1 2 3 1 0 0\nv 2.5 2.125 3.25 0.003922 0.007843 0.01176\np 1\np 2\n");
    free(text);
    drop("a.obj");
    write_ok("a.ply", &mesh);
    text = read_text("a.ply", &len);
    assert_non_null(strstr(text, "element vertex 2\n"));
    assert_null(strstr(text, "element face"));
    assert_int_equal(len, strlen(text) == len ? len : (size_t)(strstr(text, "end_header\n") + 11 - text) + 2 * 27);
    free(text);
    drop("a.ply");
    write_refused("a.glb", &mesh, ".glb holds meshes, but there are no faces; allowed for points are .ply .obj");
    assert_true(mesh_takes_points("x.ply") && mesh_takes_points("x.obj") && !mesh_takes_points("x.fbx"));
}

/* A long file is written past the system's cache, in whole buffers, and ends with the vertices as given. */
static void long_file(void **state)
{
    enum { MANY = 700000, ROW = 24, AT_ONCE = 1000 };
    struct stat st;
    uint8_t row[AT_ONCE * ROW];
    (void)state;
    double(*many)[3] = calloc(MANY, sizeof *many);
    assert_non_null(many);
    for (int i = 0; i < MANY; i++)
        for (int k = 0; k < 3; k++)
            many[i][k] = i + 0.25 * k;
    const struct mesh mesh = {.n_vertices = MANY, .xyz_m = (const double(*)[3])many};
    write_ok("long.ply", &mesh);
    const int fd = open(path_in("long.ply"), O_RDONLY);
    assert_int_equal(fstat(fd, &st), 0);
    assert_true(st.st_size > (off_t)MANY * ROW && st.st_size < (off_t)MANY * ROW + 1000);
    for (int i = 0; i < MANY; i += AT_ONCE) {
        assert_int_equal(pread(fd, row, sizeof row, st.st_size - (off_t)(MANY - i) * ROW), sizeof row);
        assert_memory_equal(row, many[i], sizeof row);
    }
    close(fd);
    free(many);
    drop("long.ply");
}

static void what_is_refused(void **state)
{
    (void)state;
    static const double broken[1][3] = {{1, (double)NAN, 2}};
    static const uint32_t beyond[1][3] = {{0, 1, 7}};
    const struct mesh_part bad[2] = {{"a", 3, 2, NULL, NULL}, {"b", 4, 2, NULL, NULL}}; /* face 2 uses vertex 3 */
    const struct mesh_part few[1] = {{"a", 4, 2, NULL, NULL}};
    struct mesh mesh = {.n_vertices = 1, .xyz_m = broken};
    write_refused("a.stl", &mesh, "no mesh format has this ending; allowed are .ply .obj .gltf .glb .fbx");
    write_refused("ply", &mesh, "no mesh format has this ending");
    assert_true(!mesh_has_format("a.stl") && mesh_has_format("a.PLY"));
    write_refused("a.ply", &mesh, "vertex 1 of 1 is not finite: 1 nan 2");
    mesh = sheet();
    mesh.n_parts = 0;
    mesh.face = beyond;
    mesh.n_faces = 1;
    write_refused("a.obj", &mesh, "face 1 uses vertex 7; allowed are 0 to 6");
    mesh = sheet();
    mesh.part = bad;
    write_refused("a.obj", &mesh, "face 2 uses vertex 3; allowed are 0 to 2");
    mesh.part = few;
    mesh.n_parts = 1;
    write_refused("a.obj", &mesh, "its parts do not add up to its 7 vertices and 4 faces");
    mesh = sheet();
    mesh.n_parts = 0;
    mesh.texture = "a.png";
    mesh.uv = NULL;
    write_refused("a.glb", &mesh, "it has a texture but no texture coordinates");
    mesh = sheet();
    mesh.n_parts = MESH_MAX_PARTS + 1;
    write_refused("a.obj", &mesh, "parts; allowed are up to ");
    mesh = sheet();
    mesh.n_vertices = MESH_MAX_VERTICES + 1U;
    write_refused("a.ply", &mesh, "vertices; allowed are up to ");
    for (int i = 0; i < 5; i++) { /* the last vertex's */
        float up[N_VERTICES][3] = {{0}}, at[N_VERTICES][2] = {{0}};
        *(i < 3 ? &up[N_VERTICES - 1][i] : &at[N_VERTICES - 1][i - 3]) = i % 2 ? (float)INFINITY : (float)NAN;
        mesh = sheet();
        mesh.normal = (const float(*)[3])up;
        mesh.uv = (const float(*)[2])at;
        write_refused("a.obj", &mesh,
                      i < 3 ? "the normal of vertex 7 is not finite"
                            : "the texture coordinate of vertex 7 is not finite");
    }
}

/* Half a step of float at 5.4e6 m is 0.25 m: 5.4e6 lies between 2^22 and 2^23, where floats are 2^-1 apart. The bound
 * is 2^-24 of the coordinate, 0.32 m. A mesh of 12 m may have errors of 12 micrometres. */
static void floats_that_are_too_coarse(void **state)
{
    (void)state;
    double far[N_VERTICES][3];
    struct mesh mesh = sheet();
    memcpy(far, xyz, sizeof xyz);
    for (int i = 0; i < N_VERTICES; i++)
        far[i][1] += 5.4e6;
    mesh.xyz_m = (const double(*)[3])far;
    write_refused("a.glb", &mesh,
                  "moves coordinates of 5400004 m by up to 0.32 m; allowed for a mesh of 12.79 m are 1.3e-05 m");
    write_refused("a.fbx", &mesh, "write .ply or .obj, or keep coordinates near 0");
    write_ok("a.ply", &mesh);
    drop("a.ply");
    const double low[3] = {-100, -100, -2}, high[3] = {100, 100, 30};
    assert_int_equal(mesh_check_box("a.gltf", low, high, &err), SH_OK);
}

static int stop_now(void *ctx)
{
    (void)ctx;
    return 1;
}

/* An earlier file does not change. */
static void whole_or_not_at_all(void **state)
{
    (void)state;
    static const char *const name[] = {"a.gltf", "a.glb", "a.fbx"};
    const struct sh_report report = {.stop = stop_now};
    const struct mesh mesh = sheet();
    size_t len;
    for (size_t i = 0; i < 3; i++) {
        write_text(name[i], "before");
        assert_int_equal(mesh_write(path_in(name[i]), &mesh, &report, &err), SH_ESTOPPED);
        char *text = read_text(name[i], &len);
        assert_string_equal(text, "before");
        free(text);
        drop(name[i]);
    }
    assert_int_equal(symlink("nowhere", path_in("a.bin")), 0);
    assert_int_equal(mesh_write(path_in("a.gltf"), &mesh, NULL, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "a.bin: is a symbolic link"));
    assert_int_equal(access(path_in("a.gltf"), F_OK), -1);
    drop("a.bin");
}

static uint64_t get64(const char *p)
{
    uint64_t v = 0;
    for (int i = 7; i >= 0; i--)
        v = v << 8 | (uint8_t)p[i];
    return v;
}

/* After the last list come 16 bytes, 4 zeros, 1 to 16 zeros up to a multiple of 16, the version, 120 zeros, and the
 * mark of the end. Readers look for the mark. Its bytes here are those of Blender's exporter. */
static void check_end(const char *fbx, size_t at, size_t end)
{
    static const char zero[120];
    static const char mark[] = "\xf8\x5a\x8c\x6a\xde\xf5\xd9\x7e\xec\xe9\x0c\xe3\x75\x8f\x29\x0b";
    const size_t version = (at + 16 + 4) / 16 * 16 + 16;
    assert_int_equal(end, version + 4 + 120 + 16);
    assert_memory_not_equal(fbx + at, zero, 16);
    assert_memory_equal(fbx + at + 16, zero, version - at - 16);
    assert_memory_equal(fbx + version, fbx + 23, 4); /* that of the file's head */
    assert_memory_equal(fbx + version + 4, zero, 120);
    assert_memory_equal(fbx + version + 124, mark, 16);
}

/* Counts the nodes from `from` to `end`; each list of nodes ends with 25 zeros. */
static unsigned count_nodes(const char *fbx, size_t from, size_t end, int is_top)
{
    static const char zero[25];
    unsigned n = 0;
    for (size_t p = from; p < end;) {
        const uint64_t next = get64(fbx + p);
        if (next == 0) {
            assert_memory_equal(fbx + p, zero, 25);
            if (is_top)
                check_end(fbx, p + 25, end);
            else
                assert_int_equal(p + 25, end);
            return n;
        }
        const size_t inside = p + 25 + (uint8_t)fbx[p + 24] + (size_t)get64(fbx + p + 16);
        assert_true(next <= end && inside <= next);
        n += 1 + (inside < next ? count_nodes(fbx, inside, (size_t)next, 0) : 0);
        p = (size_t)next;
    }
    fail_msg("a list of nodes from %zu to %zu has no end", from, end);
    return 0;
}

/* The file has the ends that Blender needs. The bytes are the same each time, though the exporter writes the time of
 * day. */
static void fbx_has_all_ends(void **state)
{
    (void)state;
    const struct mesh mesh = sheet();
    size_t len, len2;
    write_ok("a.fbx", &mesh);
    char *fbx = read_text("a.fbx", &len);
    assert_true(count_nodes(fbx, 27, len, 1) > 100);
    const char *year = memmem(fbx, len, "\x04YearI", 6);
    assert_non_null(year);
    assert_memory_equal(year + 6, "\xb2\x07\0\0", 4); /* 1970 */
    write_ok("b.fbx", &mesh);
    char *again = read_text("b.fbx", &len2);
    assert_int_equal(len, len2);
    assert_memory_equal(fbx, again, len);
    free(fbx);
    free(again);
    drop("a.fbx");
    drop("b.fbx");
}

/* sRGB 188 is half the light: 0.5029 (IEC 61966-2-1: ((188 / 255 + 0.055) / 1.055) ^ 2.4). */
static void gltf_colours_are_linear(void **state)
{
    (void)state;
    static const uint8_t grey[N_VERTICES][3] = {{188, 0, 255}, {188, 0, 255}, {188, 0, 255}, {188, 0, 255},
                                                {188, 0, 255}, {188, 0, 255}, {188, 0, 255}};
    struct mesh mesh = sheet();
    size_t len;
    mesh.n_parts = 0;
    mesh.uv = NULL;
    mesh.rgb = grey;
    write_ok("a.glb", &mesh);
    char *glb = read_text("a.glb", &len);
    const float value[4] = {(float)pow((188 / 255.0 + 0.055) / 1.055, 2.4), 0, 1, 1};
    assert_true(fabs((double)value[0] - 0.5029) < 1e-4);
    assert_non_null(memmem(glb, len, value, sizeof value));
    assert_non_null(memmem(glb, len, "COLOR_0", 7));
    free(glb);
    mesh.uv = uv;
    mesh.texture = "a.png"; /* the image is the colour then */
    write_ok("a.glb", &mesh);
    glb = read_text("a.glb", &len);
    assert_null(memmem(glb, len, "COLOR_0", 7));
    assert_non_null(memmem(glb, len, "a.png", 5));
    free(glb);
    drop("a.glb");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_format_is_read_back),
        cmocka_unit_test(ply_as_text),
        cmocka_unit_test(points_alone),
        cmocka_unit_test(long_file),
        cmocka_unit_test(what_is_refused),
        cmocka_unit_test(floats_that_are_too_coarse),
        cmocka_unit_test(whole_or_not_at_all),
        cmocka_unit_test(fbx_has_all_ends),
        cmocka_unit_test(gltf_colours_are_linear),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
