/* SPDX-License-Identifier: MIT */
/* Meshes whose recorder was killed while it wrote them, at any length. */
#include "core/studio/mesh.h"
#include "tests/common/thorough.h"
#include "tests/unit/killed_rig.h"

enum { EACH = SANITIZED ? 37 : 1 }; /* a cut after each byte, or each 37th */

static char *whole;
static size_t whole_len;

/* Two parts have a square each. Colours and normals make the longest lines. */
static char *write_mesh(const char *path, int ascii, size_t *len)
{
    static const double xyz_m[8][3] = {{0, 0, 0},    {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                       {5, 0, 1e-3}, {6, 0, 0}, {6, 1, 0}, {5, 1, -123456.789}};
    static const float normal[8][3] = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}, {0, 0, 1},
                                       {0, 0, 1}, {0, 0, 1}, {0, 0, 1}, {0, 0, 1}};
    static const float uv[8][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}, {0, 0}, {1, 0}, {1, 1}, {0, 1}};
    static const uint8_t rgb[8][3] = {{1, 2, 3}};
    static const uint32_t face[4][3] = {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}};
    static const struct mesh_part part[2] = {{"station 1", 4, 2, "a.png", NULL}, {"station 2", 4, 2, "b.png", NULL}};
    static const char *const comment[] = {"crs local"};
    const struct mesh mesh = {.n_vertices = 8,
                              .n_faces = 4,
                              .xyz_m = xyz_m,
                              .normal = normal,
                              .rgb = rgb,
                              .uv = uv,
                              .face = face,
                              .part = part,
                              .n_parts = 2,
                              .comment = comment,
                              .n_comments = 1,
                              .ascii = ascii};
    struct sh_err err = {0};
    if (mesh_write(path, &mesh, NULL, &err) != SH_OK) fail_msg("%s", err.text);
    char *text = (char *)rig_read(path, len);
    unlink(path);
    unlink(rig_path("a.mtl"));
    return text;
}

static size_t lines_that_begin(const char *text, size_t len, const char *key)
{
    size_t n = 0;
    for (size_t at = 0; at < len; at += strcspn(text + at, "\n") + 1)
        n += strncmp(text + at, key, strlen(key)) == 0;
    return n;
}

static const char NOTE[] = "# incomplete: ";

static void test_cuts(void **state)
{
    (void)state;
    struct repair r;
    struct sh_err err;
    size_t len, again_len;
    for (size_t cut = 0; cut <= whole_len; cut += EACH) {
        const char *path = rig_path("cut.obj.part");
        size_t end = cut;
        while (end > 0 && whole[end - 1] != '\n')
            end--;
        killed_rig_write(path, whole, cut);
        const size_t n = lines_that_begin(whole, end, "v ");
        if (n == 0) {
            assert_int_equal(killed_rig_repair(path, &r, &err), SH_EFORMAT);
            continue;
        }
        if (killed_rig_repair(path, &r, &err) != 0) fail_msg("%s", err.text);
        assert_int_equal(r.n_kept, n);
        assert_int_equal(r.n_scans, lines_that_begin(whole, end, "o "));
        assert_int_equal(r.cut_bytes, cut - end);
        assert_int_equal(r.was_whole, 0); /* it can't be known */
        char *now = (char *)rig_read(path, &len);
        assert_memory_equal(now, whole, end);
        assert_memory_equal(now + end, NOTE, sizeof NOTE - 1);
        assert_ptr_equal(strchr(now + end, '\n'), now + len - 1);
        assert_int_equal(killed_rig_repair(path, &r, &err), 0);
        assert_int_equal(r.was_whole, 1);
        char *again = (char *)rig_read(path, &again_len);
        assert_string_equal(again, now);
        free(again);
        free(now);
    }
    unlink(rig_path("cut.obj.part"));
}

/* A whole file does not change. Other files, damage and absurd numbers are refused in a line. */
static void test_refused(void **state)
{
    (void)state;
    static const char *const bad[] = {"",
                                      "ply\nformat ascii 1.0\n",
                                      "v 1 2 3\nhello\nv 1 2 3\n",
                                      "v 1 2 3\nf 1 2 3\nv 4 5 6\n",
                                      "v 1 2 3\nf 18446744073709551617 1 1\nv 1 2 3\n",
                                      "o nothing\n"};
    struct repair r;
    struct sh_err err;
    const char *path = rig_path("cut.obj");
    killed_rig_write(path, whole, whole_len);
    assert_int_equal(killed_rig_repair(path, &r, &err), 0);
    assert_int_equal(r.was_whole, 1);
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        killed_rig_write(path, bad[i], strlen(bad[i]));
        assert_int_equal(killed_rig_repair(path, &r, &err), SH_EFORMAT);
        assert_null(strchr(err.text, '\n'));
    }
    unlink(path);
}

/* A comment has the names of an object and a material, of 255 bytes each at most. */
static void test_long_names(void **state)
{
    (void)state;
    char text[600], name[256];
    struct repair r;
    struct sh_err err;
    const char *path = rig_path("cut.obj");
    memset(name, 'n', 255);
    name[255] = '\0';
    const int len = snprintf(text, sizeof text, "# crs local\n# label 65534 %s | %s\nv 1 2 3\n", name, name);
    killed_rig_write(path, text, (size_t)len);
    if (killed_rig_repair(path, &r, &err) != 0) fail_msg("%s", err.text);
    assert_true(r.was_whole && r.n_kept == 1);
    unlink(path);
}

/* A .ply is complete, or none of it is kept. */
static void test_ply(void **state)
{
    (void)state;
    struct repair r;
    struct sh_err err;
    size_t len;
    for (int ascii = 0; ascii < 2; ascii++) {
        const char *path = rig_path("cut.ply.part");
        char *mesh = write_mesh(rig_path("a.ply"), ascii, &len);
        for (size_t cut = 1 + (len - 1) % EACH; cut <= len; cut += EACH) {
            killed_rig_write(path, mesh, cut);
            const int rc = killed_rig_repair(path, &r, &err);
            assert_int_equal(rc, cut == len ? 0 : SH_EFORMAT);
            assert_null(strchr(err.text, '\n'));
        }
        assert_int_equal(r.was_whole, 1);
        assert_int_equal(r.n_kept, 8);
        unlink(path);
        free(mesh);
    }
}

/* The bytes of a binary mesh are no lines: more than 64 KiB of them may come without a newline (10). */
static void test_ply_without_newlines(void **state)
{
    (void)state;
    enum { N = 4000 };
    static const double xyz_m[N][3];
    static const uint32_t face[3][3] = {{0, 1, 2}, {10, 11, 12}, {10, 12, 13}};
    const struct mesh mesh = {.n_vertices = N, .n_faces = 3, .xyz_m = xyz_m, .face = face};
    struct repair r;
    struct sh_err err = {0};
    const char *path = rig_path("a.ply");
    if (mesh_write(path, &mesh, NULL, &err) != SH_OK) fail_msg("%s", err.text);
    if (killed_rig_repair(path, &r, &err) != SH_OK) fail_msg("%s", err.text);
    assert_int_equal(r.was_whole, 1);
    assert_int_equal(r.n_kept, N);
    unlink(path);
}

static int set_up(void **state)
{
    const int rc = rig_set_up(state);
    if (rc == 0) whole = write_mesh(rig_path("a.obj"), 0, &whole_len);
    return rc;
}

static int tear_down(void **state)
{
    free(whole);
    return rig_tear_down(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_cuts),
        cmocka_unit_test(test_refused),
        cmocka_unit_test(test_long_names),
        cmocka_unit_test(test_ply),
        cmocka_unit_test(test_ply_without_newlines),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
