/* Meshes as .obj whose recorder was killed while it wrote them, wherever they end. */
#include "core/mesh.h"
#include "tests/unit/killed_rig.h"

static char *whole;
static size_t whole_len;

/* Two parts of a square each; colours and normals make the lines as long as they get. */
static void write_mesh(void)
{
    static const double xyz_m[8][3] = {{0, 0, 0},    {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                       {5, 0, 1e-3}, {6, 0, 0}, {6, 1, 0}, {5, 1, -123456.789}};
    static const float normal[8][3] = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}, {0, 0, 1},
                                       {0, 0, 1}, {0, 0, 1}, {0, 0, 1}, {0, 0, 1}};
    static const float uv[8][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}, {0, 0}, {1, 0}, {1, 1}, {0, 1}};
    static const uint8_t rgb[8][3] = {{1, 2, 3}};
    static const uint32_t face[4][3] = {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}};
    static const struct mesh_part part[2] = {{"station 1", 4, 2, "a.png"}, {"station 2", 4, 2, "b.png"}};
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
                              .n_comments = 1};
    struct sh_err err = {0};
    if (mesh_write(rig_path("a.obj"), &mesh, NULL, &err) != SH_OK) fail_msg("%s", err.text);
    whole = (char *)rig_read(rig_path("a.obj"), &whole_len);
    unlink(rig_path("a.obj"));
    unlink(rig_path("a.mtl"));
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
    for (size_t cut = 0; cut <= whole_len; cut++) {
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
        assert_int_equal(r.was_whole, 0); /* nobody can tell */
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

/* A whole file is as it was; other files, damage and absurd numbers are refused in a line. */
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

static int set_up(void **state)
{
    const int rc = rig_set_up(state);
    if (rc == 0) write_mesh();
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
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
