/* SPDX-License-Identifier: MIT */
/* A scene on its way back from the process that read it: it comes unchanged, and broken bytes are refused. */
#include <math.h>
#include <sys/mman.h>

#include "core/import/import_result.h"
#include "core/scene/build_load.h"
#include "tests/common/thorough.h"
#include "tests/unit/scene_files.h"

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

/* Writes it as bytes. */
static size_t write_result(uint8_t *bytes, size_t room)
{
    struct sh_err err;
    int fd = memfd_create("result", MFD_CLOEXEC);
    struct scene *s = small_scene();
    assert_int_equal(import_result_write(s, fd, &err), SH_OK);
    scene_free(s);
    ssize_t n = pread(fd, bytes, room, 0);
    assert_true(n > 0 && (size_t)n < room);
    close(fd);
    return (size_t)n;
}

static int read_result(const uint8_t *bytes, size_t n, struct scene_build *b, struct sh_err *err)
{
    static const struct scene_mesh_spec spec = {.file = "some/a.dae", .scale = 1, .textures = 1};
    int fd = memfd_create("result", MFD_CLOEXEC);
    assert_int_equal(write(fd, bytes, n), n);
    assert_int_equal(build_init(b, 1e-3, NULL, err), SH_OK);
    build_begin_file(b, &spec);
    int rc = import_result_read(b, fd, err);
    close(fd);
    return rc;
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

/* Returns whether the byte is in the middle of a name's free bytes, of which any one is like the rest. */
static int is_padding(const uint8_t *bytes, size_t at, size_t n)
{
    static const uint8_t none[36];
    return at >= 16 && at + 20 <= n && memcmp(bytes + at - 16, none, sizeof none) == 0;
}

/* Every word of it gets every value with an effect: counts too large, indices out of range, NaN, infinite, names
 * without an end; and many lengths. */
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(result_comes_back),
        cmocka_unit_test(broken_result_is_refused),
        cmocka_unit_test(names_have_an_end),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
