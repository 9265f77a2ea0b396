/* SPDX-License-Identifier: MIT */
/* A scene on its way back from the process that read it: it comes unchanged, and broken bytes are refused. */
#include <math.h>
#include <sys/mman.h>
#include <sys/syscall.h>

#include "core/import/import_result.h"
#include "core/scene/build_load.h"
#include "tests/common/thorough.h"
#include "tests/unit/scene_files.h"

/* A call of write() writes at most so many bytes. */
static size_t most_at_once = SIZE_MAX;

ssize_t write(int fd, const void *bytes, size_t len)
{
    return syscall(SYS_write, fd, bytes, len < most_at_once ? len : most_at_once);
}

static void *copy_of(const void *data, size_t size)
{
    void *copy = malloc(size);
    assert_non_null(copy);
    return memcpy(copy, data, size);
}

/* Makes two triangles of two surfaces, one with a texture that came within the file. */
static struct scene *small_scene(void)
{
    static const double vertex_m[4][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0.25}};
    static const uint32_t triangle[2][3] = {{0, 1, 2}, {0, 2, 3}};
    static const uint16_t label[2] = {0, 1};
    static const float uv[2][3][2] = {{{0, 0}, {1, 0}, {1, 1}}, {{NAN, NAN}, {NAN, NAN}, {NAN, NAN}}};
    struct scene *s = calloc(1, sizeof *s);
    assert_non_null(s);
    *s = (struct scene){.n_vertices = 4, .n_triangles = 2, .n_surfaces = 2, .n_meshes = 1, .n_textures = 1};
    s->vertex_m = copy_of(vertex_m, sizeof vertex_m);
    s->triangle = copy_of(triangle, sizeof triangle);
    s->label = copy_of(label, sizeof label);
    s->uv = copy_of(uv, sizeof uv);
    s->surface = calloc(2, sizeof *s->surface);
    s->texture = calloc(1, sizeof *s->texture);
    assert_true(s->surface != NULL && s->texture != NULL);
    s->surface[0] =
        (struct scene_surface){"wall", "paint", {0.5f, 0.25f, 1.0f}, .has_colour = 1, .texture = 1, .solid = 0.5f};
    s->surface[1] = (struct scene_surface){.object = "floor"};
    s->texture[0] = (struct scene_texture){.file = strdup("some/a.dae*0"), .bytes = copy_of("pixels", 6), .n_bytes = 6};
    s->counts.zero_area = 3;
    return s;
}

/* Writes a scene as bytes, and frees it. */
static size_t write_scene(struct scene *s, uint8_t *bytes, size_t room)
{
    struct sh_err err;
    int fd = memfd_create("result", MFD_CLOEXEC);
    assert_int_equal(import_result_write(s, fd, &err), SH_OK);
    scene_free(s);
    ssize_t n = pread(fd, bytes, room, 0);
    assert_true(n > 0 && (size_t)n < room);
    close(fd);
    return (size_t)n;
}

static size_t write_result(uint8_t *bytes, size_t room)
{
    return write_scene(small_scene(), bytes, room);
}

/* Reads one more file into the builder. */
static int read_more(const uint8_t *bytes, size_t n, struct scene_build *b, struct sh_err *err)
{
    static const struct scene_mesh_spec spec = {.file = "some/a.dae", .scale = 1, .textures = 1};
    int fd = memfd_create("result", MFD_CLOEXEC);
    assert_int_equal(write(fd, bytes, n), n);
    build_begin_file(b, &spec);
    int rc = import_result_read(b, fd, err);
    close(fd);
    return rc;
}

static int read_result(const uint8_t *bytes, size_t n, struct scene_build *b, struct sh_err *err)
{
    assert_int_equal(build_init(b, 1e-3, NULL, err), SH_OK);
    return read_more(bytes, n, b, err);
}

static void result_comes_back(void **state)
{
    (void)state;
    uint8_t bytes[4096];
    struct scene_build b;
    struct sh_err err = {0};
    struct scene *want = small_scene();
    size_t n = write_result(bytes, sizeof bytes);
    if (read_result(bytes, n, &b, &err) != SH_OK) fail_msg("%s", err.text);
    const struct scene *s = b.scene;
    assert_true(s->n_vertices == 4 && s->n_triangles == 2 && s->n_surfaces == 2 && s->n_textures == 1);
    assert_memory_equal(s->vertex_m, want->vertex_m, 4 * sizeof *s->vertex_m);
    assert_memory_equal(s->triangle, want->triangle, 2 * sizeof *s->triangle);
    assert_memory_equal(s->label, want->label, 2 * sizeof *s->label);
    assert_memory_equal(s->uv, want->uv, 2 * sizeof *s->uv);
    for (int i = 0; i < 2; i++) {
        assert_string_equal(s->surface[i].object, want->surface[i].object);
        assert_string_equal(s->surface[i].material, want->surface[i].material);
        assert_int_equal(s->surface[i].texture, want->surface[i].texture);
        assert_int_equal(s->surface[i].has_colour, want->surface[i].has_colour);
    }
    assert_memory_equal(s->surface[0].colour, want->surface[0].colour, sizeof s->surface[0].colour);
    assert_string_equal(s->texture[0].file, "some/a.dae*0");
    assert_true(s->texture[0].n_bytes == 6 && memcmp(s->texture[0].bytes, "pixels", 6) == 0);
    assert_int_equal(s->counts.zero_area, 3);
    scene_free(want);
    build_release(&b);
}

/* A write may write only a part, as Linux does beyond 2 GiB. */
static void parts_are_written_one_after_another(void **state)
{
    (void)state;
    static uint8_t at_once[4096], in_parts[4096];
    const size_t n = write_result(at_once, sizeof at_once);
    most_at_once = 13;
    const size_t n_in_parts = write_result(in_parts, sizeof in_parts);
    most_at_once = SIZE_MAX;
    assert_int_equal(n_in_parts, n);
    assert_memory_equal(in_parts, at_once, n);
}

/* Checks the properties that every user of a scene relies on. */
static void check_scene(const struct scene *s)
{
    for (uint32_t i = 0; i < s->n_vertices; i++)
        for (int k = 0; k < 3; k++)
            assert_true(fabs(s->vertex_m[i][k]) <= SCENE_MAX_COORDINATE_M);
    for (uint32_t i = 0; i < s->n_triangles; i++) {
        assert_true(s->label[i] < s->n_surfaces);
        for (int c = 0; c < 3; c++)
            assert_true(s->triangle[i][c] < s->n_vertices && (s->uv == NULL || !isinf(s->uv[i][c][0])));
    }
    for (uint32_t i = 0; i < s->n_surfaces; i++) {
        assert_true(strnlen(s->surface[i].object, SCENE_NAME_LEN) < SCENE_NAME_LEN);
        assert_true(s->surface[i].texture <= s->n_textures);
    }
}

static unsigned n_refused;

static void try_result(const uint8_t *bytes, size_t n)
{
    struct scene_build b;
    struct sh_err err = {0};
    if (read_result(bytes, n, &b, &err) == SH_OK) {
        check_scene(b.scene);
    } else {
        n_refused++;
        if (strstr(err.text, "some/a.dae") != err.text || strchr(err.text, '\n') != NULL) fail_msg("'%s'", err.text);
    }
    build_release(&b);
}

/* Returns whether the byte is in the middle of a name's unused bytes, which are all alike. */
static int is_padding(const uint8_t *bytes, size_t at, size_t n)
{
    static const uint8_t none[36];
    return at >= 16 && at + 20 <= n && memcmp(bytes + at - 16, none, sizeof none) == 0;
}

/* Every word of the result gets values that may do harm: counts too large, indices out of range, NaN, names without an
 * end. Then it is cut at many lengths. */
static void broken_result_is_refused(void **state)
{
    (void)state;
    static const uint32_t values[] = {0, 0x7fffffff, 0xffffffff, 0x7ff00000, 0x41414141};
    static uint8_t bytes[4096], broken[4096];
    size_t n = write_result(bytes, sizeof bytes);
    n_refused = 0;
    for (size_t at = 0; at + 4 <= n; at += SANITIZED ? 28 : 4) {
        if (is_padding(bytes, at, n)) continue;
        for (size_t i = 0; i < sizeof values / sizeof values[0]; i++) {
            memcpy(broken, bytes, n);
            memcpy(broken + at, &values[i], 4);
            try_result(broken, n);
        }
    }
    assert_true(n_refused > (unsigned)fewer(100)); /* of 700; most of the words are of names, which may be anything */
    n_refused = 0;
    for (size_t len = 0; len < n; len += SANITIZED ? 91 : 13)
        try_result(bytes, len);
    assert_int_equal(n_refused, SANITIZED ? (n + 90) / 91 : (n + 12) / 13); /* too short, all of them */
    memcpy(broken, bytes, n);
    n_refused = 0;
    try_result(broken, n + 4);
    assert_int_equal(n_refused, 1);
}

/* A name has no end within its field. */
static void names_have_an_end(void **state)
{
    (void)state;
    static uint8_t bytes[4096];
    struct scene_build b;
    struct sh_err err;
    size_t n = write_result(bytes, sizeof bytes);
    uint8_t *name = memmem(bytes, n, "floor", 6);
    assert_non_null(name);
    memset(name, 'a', SCENE_NAME_LEN);
    assert_int_equal(read_result(bytes, n, &b, &err), SH_EINPUT);
    assert_string_equal(err.text,
                        "some/a.dae: the reader's result is inconsistent: a name of surface 1; the file is broken");
    build_release(&b);
}

/* Makes the small scene with a value of its own in each field that a reader may fill. */
static struct scene *full_scene(void)
{
    static const uint8_t rgb[2][3][4] = {{{1, 2, 3, 255}, {4, 5, 6, 255}, {7, 8, 9, 255}}, {{0}, {10, 11, 12, 255}}};
    struct scene *s = small_scene();
    s->rgb = copy_of(rgb, sizeof rgb);
    s->texture = realloc(s->texture, 2 * sizeof *s->texture);
    assert_non_null(s->texture);
    s->texture[0].raw_width = 1, s->texture[0].raw_height = 2;
    s->texture[0].wrap[0] = TEXTURE_DECAL, s->texture[0].wrap[1] = TEXTURE_MIRROR;
    s->texture[1] = (struct scene_texture){.file = strdup("some/b.png"), .bytes = copy_of("x", 1), .n_bytes = 1};
    s->n_textures = 2;
    s->surface[0].opacity = 2;
    s->surface[0].clear = 0.125f;
    s->surface[1].has_colour = 1; /* the ends of what is allowed */
    s->surface[1].clear = s->surface[1].solid = s->surface[1].colour[2] = 1.0f;
    s->counts = (struct scene_counts){.zero_area = 3, .not_triangles = 5, .names_cut = 7};
    s->n_meshes = 11;
    s->error_m = 0.0625;
    s->says = (struct scene_says){.unit_m = 0.0254, .up = -2, .is_left_handed = 1};
    return s;
}

static void expect_surface(const struct scene_surface *got, const struct scene_surface *want)
{
    assert_memory_equal(got->colour, want->colour, sizeof got->colour);
    assert_true(got->has_colour == want->has_colour && got->texture == want->texture && got->opacity == want->opacity);
    assert_true(got->clear == want->clear && got->solid == want->solid);
}

/* Counts of files add up, and the largest error counts. A name that is there keeps its surface as it was. Textures of
 * the same name are one. */
static void each_field_comes_back(void **state)
{
    (void)state;
    static uint8_t bytes[4096];
    struct scene_build b;
    struct sh_err err = {0};
    struct scene *want = full_scene(), *second = full_scene();
    size_t n = write_scene(full_scene(), bytes, sizeof bytes);
    if (read_result(bytes, n, &b, &err) != SH_OK) fail_msg("%s", err.text);
    second->surface[0] = (struct scene_surface){"wall", "paint", {1, 1, 1}, .has_colour = 1, .clear = 0.5f, .solid = 1};
    second->error_m = 0.03125;
    second->says = (struct scene_says){.unit_m = 1.0, .up = 3};
    n = write_scene(second, bytes, sizeof bytes);
    if (read_more(bytes, n, &b, &err) != SH_OK) fail_msg("%s", err.text);
    const struct scene *s = b.scene;
    assert_true(s->n_vertices == 8 && s->n_triangles == 4 && s->n_surfaces == 2 && s->n_textures == 2);
    for (int file = 0; file < 2; file++) {
        assert_memory_equal(s->rgb[2 * file], want->rgb, 2 * sizeof *s->rgb);
        assert_memory_equal(s->uv[2 * file], want->uv, 2 * sizeof *s->uv);
        assert_memory_equal(s->label + 2 * file, want->label, 2 * sizeof *s->label);
        expect_surface(&s->surface[file], &want->surface[file]);
    }
    for (int i = 0; i < 2; i++) {
        const struct scene_texture *t = &s->texture[i], *w = &want->texture[i];
        assert_true(t->raw_width == w->raw_width && t->raw_height == w->raw_height);
        assert_true(t->wrap[0] == w->wrap[0] && t->wrap[1] == w->wrap[1] && t->n_bytes == w->n_bytes);
        assert_true((t->bytes == NULL) == (w->bytes == NULL));
    }
    assert_true(s->counts.zero_area == 6 && s->counts.not_triangles == 10 && s->counts.names_cut == 14);
    assert_true(s->n_meshes == 22 && s->error_m == 0.0625);
    assert_true(s->says.unit_m == 1.0 && s->says.up == 3 && s->says.is_left_handed == 0);
    build_release(&b);
    /* The second file's error is the larger one here. */
    n = write_scene(small_scene(), bytes, sizeof bytes);
    assert_int_equal(read_result(bytes, n, &b, &err), SH_OK);
    n = write_scene(full_scene(), bytes, sizeof bytes);
    assert_int_equal(read_more(bytes, n, &b, &err), SH_OK);
    assert_true(b.scene->error_m == 0.0625 && b.scene->says.unit_m == 0.0254 && b.scene->says.up == -2 &&
                b.scene->says.is_left_handed == 1);
    build_release(&b);
    scene_free(want);
}

/* Sets one value of a scene; the cases in order. */
static void set_wrong(struct scene *s, int k)
{
    float *const share[4] = {&s->surface[1].clear, &s->surface[1].solid, &s->surface[1].colour[0],
                             &s->surface[1].colour[2]};
    if (k < 8) *share[k / 2] = k % 2 ? -0.001f : 1.001f;
    if (k == 8) s->surface[1].has_colour = 2;
    if (k == 9) s->surface[1].texture = 3;
    if (k == 10) s->surface[1].opacity = 3;
    if (k == 11) s->label[1] = 2;
    if (k == 12) s->triangle[1][2] = 4;
    if (k == 13) s->vertex_m[3][2] = 1.001e9;
    if (k == 14) s->vertex_m[3][0] = (double)NAN;
    if (k == 15) s->uv[1][2][1] = INFINITY;
    if (k == 16) s->uv[1][2][0] = -INFINITY;
    if (k == 17 || k == 18) s->texture[0].wrap[k - 17] = (enum texture_wrap)(TEXTURE_DECAL + 1);
    if (k == 19 || k == 20) s->says.up = k == 19 ? 4 : -4;
    if (k == 21) s->says.is_left_handed = 2;
    if (k == 22 || k == 23) s->says.unit_m = k == 22 ? -1.0 : (double)NAN;
    if (k == 24 || k == 25) s->error_m = k == 24 ? -1.0 : (double)NAN;
    if (k == 26) s->n_triangles = 0;
    if (k == 27) s->n_surfaces = 0;
}

/* Each value that no reader gives is refused, and the message names what is wrong. */
static void wrong_values_are_named(void **state)
{
    (void)state;
    static const char *const part[] = {"transparency of surface 1",
                                       "transparency of surface 1",
                                       "opacity of surface 1",
                                       "opacity of surface 1",
                                       "colour of surface 1",
                                       "colour of surface 1",
                                       "colour of surface 1",
                                       "colour of surface 1",
                                       "colour of surface 1",
                                       "texture of surface 1",
                                       "texture of surface 1",
                                       "label of triangle 1",
                                       "corner of triangle 1",
                                       "place of vertex 3",
                                       "place of vertex 3",
                                       "texture coordinates of triangle 1",
                                       "texture coordinates of triangle 1",
                                       "repetition of texture 0",
                                       "repetition of texture 0",
                                       "axes are not from -3 to 3",
                                       "axes are not from -3 to 3",
                                       "handedness of its axes is not 0 or 1",
                                       "unit is not from 0 m to 1000000000",
                                       "unit is not from 0 m to 1000000000",
                                       "error of its vertices is not from 0 m to 1000000000",
                                       "error of its vertices is not from 0 m to 1000000000",
                                       "number of triangles: 0",
                                       "number of textures: 2"};
    static uint8_t bytes[4096];
    for (int k = 0; k < (int)(sizeof part / sizeof part[0]); k++) {
        struct scene_build b;
        struct sh_err err = {0};
        struct scene *s = full_scene();
        set_wrong(s, k);
        const size_t n = write_scene(s, bytes, sizeof bytes);
        assert_int_equal(read_result(bytes, n, &b, &err), SH_EINPUT);
        if (strstr(err.text, part[k]) == NULL) fail_msg("%d: '%s' without '%s'", k, err.text, part[k]);
        build_release(&b);
        /* As the second file of a scene it has the same numbers. */
        uint8_t good[4096];
        const size_t n_good = write_result(good, sizeof good);
        assert_int_equal(read_result(good, n_good, &b, &err), SH_OK);
        assert_int_equal(read_more(bytes, n, &b, &err), SH_EINPUT);
        if (strstr(err.text, part[k]) == NULL) fail_msg("%d, second: '%s' without '%s'", k, err.text, part[k]);
        build_release(&b);
    }
}

/* Bytes are changed where they lie. The magic has 8, and counts follow it. The length of the texture's path, 64 bits,
 * comes first, then the texture's figures, then the path. */
static void wrong_bytes_are_named(void **state)
{
    (void)state;
    static const char *const says[] = {
        "the header is wrong at byte 0; ", "texture coordinates: 2; ", "colours: 2; ",
        "the path of texture 0; ",         "the name of texture 0; ",  "the name of texture 0; ",
        "the size of texture 0; "};
    static uint8_t bytes[4096];
    for (int k = 0; k < 7; k++) {
        struct scene_build b;
        struct sh_err err = {0};
        char want[160];
        const size_t n = write_result(bytes, sizeof bytes);
        uint8_t *name = memmem(bytes, n, "some/a.dae*0", 12), *const length = name - 32, *const size = name - 24;
        if (k == 0) bytes[7] = 'x';
        if (k == 1 || k == 2) bytes[8 + 4 * (4 + k)] = 2;
        if (k == 3) name[3] = 'x';
        if (k == 4) name[7] = 0;
        if (k == 5) *length = 0;
        if (k == 6) size[2] = 1;
        assert_int_equal(read_result(bytes, n, &b, &err), SH_EINPUT);
        snprintf(want, sizeof want, "some/a.dae: the reader's result is inconsistent: %sthe file is broken", says[k]);
        assert_string_equal(err.text, want);
        build_release(&b);
    }
}

/* Counts that the file can't hold are refused by its size, before anything is allocated for them. After the eight bytes
 * of the magic come those of vertices, triangles and surfaces; of meshes, which take no bytes; of textures. */
static void counts_beyond_the_size(void **state)
{
    (void)state;
    static uint8_t bytes[4096];
    for (size_t k = 0; k < 5; k++) {
        struct scene_build b;
        struct sh_err err = {0};
        const size_t n = write_result(bytes, sizeof bytes);
        const uint32_t many = 1000;
        memcpy(bytes + 8 + 4 * k, &many, sizeof many);
        assert_int_equal(read_result(bytes, n, &b, &err), k == 3 ? SH_OK : SH_EINPUT);
        if (k != 3 && strstr(err.text, "its size is") == NULL) fail_msg("%zu: %s", k, err.text);
        build_release(&b);
    }
}

/* A strip is longer than what is read at a time. Each triangle keeps its own corners, label, coordinates and colours.
 */
static void long_results_come_back(void **state)
{
    (void)state;
    enum { N = 8192 + 3, ROOM = 1 << 20 };
    struct scene *s = small_scene();
    uint8_t *bytes = malloc(ROOM);
    struct scene_build b;
    struct sh_err err = {0};
    assert_non_null(bytes);
    s->n_vertices = N + 2;
    s->n_triangles = N;
    s->vertex_m = realloc(s->vertex_m, s->n_vertices * sizeof *s->vertex_m);
    s->triangle = realloc(s->triangle, N * sizeof *s->triangle);
    s->label = realloc(s->label, N * sizeof *s->label);
    s->uv = realloc(s->uv, N * sizeof *s->uv);
    s->rgb = malloc(N * sizeof *s->rgb);
    for (uint32_t i = 0; i < N + 2; i++)
        for (int k = 0; k < 3; k++)
            s->vertex_m[i][k] = k == 0 ? 0.25 * i : k == 1 ? i % 2 : 0.0;
    for (uint32_t i = 0; i < N; i++) {
        s->label[i] = i % 3 == 0;
        for (uint32_t c = 0; c < 3; c++) {
            s->triangle[i][c] = i + c;
            s->uv[i][c][0] = s->uv[i][c][1] = (float)(3 * i + c);
            memcpy(s->rgb[i][c], (const uint8_t[4]){(uint8_t)i, (uint8_t)(i >> 8), (uint8_t)c, 255}, 4);
        }
    }
    const size_t n = write_scene(s, bytes, ROOM);
    if (read_result(bytes, n, &b, &err) != SH_OK) fail_msg("%s", err.text);
    s = b.scene;
    assert_true(s->n_vertices == N + 2 && s->n_triangles == N);
    for (uint32_t i = 0; i < N + 2; i++)
        assert_true(s->vertex_m[i][0] == 0.25 * i && s->vertex_m[i][1] == i % 2);
    for (uint32_t i = 0; i < N; i++) {
        assert_int_equal(s->label[i], i % 3 == 0);
        for (uint32_t c = 0; c < 3; c++) {
            assert_true(s->triangle[i][c] == i + c && s->uv[i][c][1] == (float)(3 * i + c));
            assert_true(s->rgb[i][c][0] == (uint8_t)i && s->rgb[i][c][1] == i >> 8 && s->rgb[i][c][2] == c);
        }
    }
    build_release(&b);
    free(bytes);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(result_comes_back),        cmocka_unit_test(parts_are_written_one_after_another),
        cmocka_unit_test(broken_result_is_refused), cmocka_unit_test(names_have_an_end),
        cmocka_unit_test(each_field_comes_back),    cmocka_unit_test(wrong_values_are_named),
        cmocka_unit_test(counts_beyond_the_size),   cmocka_unit_test(long_results_come_back),
        cmocka_unit_test(wrong_bytes_are_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
