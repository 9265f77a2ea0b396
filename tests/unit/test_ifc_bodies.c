/* SPDX-License-Identifier: MIT */
/* Products, parts and figures that a reader of IFC hands back. The test writes them byte by byte, also wrong ones. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>
#include <cmocka.h>

#include "core/import/ifc/ifc_bodies.h"

static const double cube[8][3] = {{2, 3, 4}, {3, 3, 4}, {2, 4, 4}, {3, 4, 4},
                                  {2, 3, 5}, {3, 3, 5}, {2, 4, 5}, {3, 4, 5}};
static const uint32_t face[12][3] = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                                     {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};

static uint8_t bytes[4096];
static size_t n_bytes;
static struct ifc_bodies bodies;
static struct sh_err err;

/* Adds data, and zeros up to a multiple of 8. Returns where they begin. */
static size_t put(const void *data, size_t n)
{
    const size_t at = n_bytes;
    memcpy(bytes + n_bytes, data, n);
    memset(bytes + n_bytes + n, 0, 8);
    n_bytes += (n + 7) / 8 * 8;
    return at;
}

static size_t put_product(uint32_t id, uint32_t n_parts, uint32_t n_failures, const char *text)
{
    const size_t at = put((const uint32_t[4]){id, n_parts, n_failures, (uint32_t)strlen(text)}, 16);
    put(text, strlen(text));
    return at;
}

/* Writes sizes, colour and largest coordinate, then the cube's vertices and first n_faces faces. Returns the begin. */
static size_t put_part(uint32_t n_faces, const float colour[4], double largest_m)
{
    uint8_t head[32];
    memcpy(head, (const uint32_t[2]){8, n_faces}, 8);
    memcpy(head + 8, colour, 16);
    memcpy(head + 24, &largest_m, 8);
    const size_t at = put(head, sizeof head);
    put(cube, sizeof cube);
    put(face, n_faces * sizeof face[0]);
    return at;
}

static const float grey[4] = {0.25f, 0.5f, 0.75f, 1.0f};

/* Product 70 has a cube and a face, 20 has 11 faces of a cube, and 50 nothing. */
static void put_all(void)
{
    n_bytes = 0;
    put("shifc01", 8);
    put_product(70, 2, 3, "IfcWall\nmore");
    put_part(12, grey, 5.0);
    put_part(1, (const float[4]){-1.0f, 2.0f, 0.0f, 0.5f}, 0.0);
    put_product(20, 1, 0, "\n");
    put_part(11, grey, 1e9);
    put_product(50, 0, 1, "IfcBeam\n");
    put((const uint32_t[4]){0}, 16);
}

static int read_bodies(size_t n)
{
    const int fd = memfd_create("bodies", MFD_CLOEXEC);
    assert_int_equal(write(fd, bytes, n), n);
    memset(&err, 0, sizeof err);
    const int rc = ifc_bodies_read(&bodies, fd, &err);
    close(fd);
    return rc;
}

static void near_to(double got, double want)
{
    if (!(fabs(got - want) < 1e-9)) fail_msg("%g, not %g", got, want);
}

static void products_by_number(void **state)
{
    (void)state;
    static const uint32_t id[3] = {20, 50, 70}, n_parts[3] = {1, 0, 2}, n_failures[3] = {0, 1, 3};
    static const char *const type[3] = {"", "IfcBeam", "IfcWall"};
    put_all();
    if (read_bodies(n_bytes) != SH_OK) fail_msg("%s", err.text);
    assert_true(bodies.n == 3 && bodies.n_parts == 3);
    for (int i = 0; i < 3; i++) {
        const struct ifc_body *b = ifc_bodies_find(&bodies, id[i]);
        assert_ptr_equal(b, &bodies.body[i]); /* rising numbers */
        assert_true(b->id == id[i] && b->n_parts == n_parts[i] && b->n_failures == n_failures[i]);
        assert_true(text_is_word(b->type, type[i]) || (b->type.n == 0 && type[i][0] == '\0'));
    }
    assert_null(ifc_bodies_find(&bodies, 0));
    assert_null(ifc_bodies_find(&bodies, 71));
    const struct ifc_part *part = &bodies.part[ifc_bodies_find(&bodies, 70)->first];
    assert_true(part[0].n_vertices == 8 && part[0].n_triangles == 12 && part[1].n_triangles == 1);
    assert_memory_equal(part[0].vertex_m, cube, sizeof cube);
    assert_memory_equal(part[0].triangle, face, sizeof face);
    assert_memory_equal(part[1].triangle, face, sizeof face[0]);
    assert_memory_equal(part[0].colour, grey, sizeof grey);
    assert_memory_equal(part[1].colour, ((const float[4]){0.0f, 1.0f, 0.0f, 0.5f}), sizeof grey); /* within 0..1 */
    assert_true(part[0].largest_m == 5.0 && part[1].largest_m == 0.0);
    ifc_bodies_free(&bodies);
    assert_true(bodies.bytes == NULL && bodies.part == NULL && bodies.body == NULL);
}

/* A cube of 1 m has 6 m2 and 1 m3. Without a triangle of 0.5 m2 it is open. The estimate of the open area is at most
 * that. */
static void figures_of_a_cube(void **state)
{
    (void)state;
    n_bytes = 0;
    put("shifc01", 8);
    for (uint32_t n = 11; n <= 12; n++) {
        put_product(n, 1, 0, "a\n");
        put_part(n, grey, 0.0);
    }
    put((const uint32_t[4]){0}, 16);
    if (read_bodies(n_bytes) != SH_OK) fail_msg("%s", err.text);
    const struct ifc_figures *open = &ifc_bodies_find(&bodies, 11)->figures,
                             *closed = &ifc_bodies_find(&bodies, 12)->figures;
    near_to(closed->area_m2, 6.0);
    near_to(closed->volume_m3, 1.0);
    near_to(open->area_m2, 5.5);
    for (int k = 0; k < 3; k++)
        assert_true(closed->min_m[k] == cube[0][k] && closed->max_m[k] == cube[7][k]);
    assert_true(ifc_is_closed(closed) && !ifc_is_closed(open));
    near_to(closed->open_m2, 0.0);
    assert_true(open->open_m2 > 0.0 && open->open_m2 <= 0.5);
    ifc_bodies_free(&bodies);
}

static void refused(const char *says)
{
    assert_int_equal(read_bodies(n_bytes), SH_EINPUT);
    if (strstr(err.text, says) == NULL) fail_msg("'%s' without '%s'", err.text, says);
    ifc_bodies_free(&bodies);
}

/* A result may end nowhere but at its own end, and nothing may follow. */
static void results_that_are_cut(void **state)
{
    (void)state;
    put_all();
    for (size_t n = 0; n < n_bytes; n += 4) {
        assert_int_equal(read_bodies(n), SH_EINPUT);
        assert_non_null(strstr(err.text, n < 8 ? "no head" : "its result is inconsistent at byte"));
        ifc_bodies_free(&bodies);
    }
    n_bytes += 8;
    refused("a product without a number");
    put_all();
    bytes[0] = 'S';
    refused("at byte 8: no head");
}

/* One body has a wrong number. It is left out, and the bodies before and after it stay. */
static void wrong_numbers_take_one_body_away(void **state)
{
    (void)state;
    static const double far = 1.0000001e9, nan_m = NAN, minus = -0.001;
    static const uint32_t beyond = 8;
    static const float no_number = NAN;
    static const struct {
        size_t at; /* in the part */
        const void *value;
        size_t size;
    } row[] = {
        {32, &far, 8},      {32 + 7 * 24 + 16, &nan_m, 8}, {32 + 192, &beyond, 4}, {32 + 192 + 11 * 12 + 8, &beyond, 4},
        {8, &no_number, 4}, {20, &no_number, 4},           {24, &minus, 8},        {24, &nan_m, 8},
        {24, &far, 8}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        n_bytes = 0;
        put("shifc01", 8);
        put_product(6, 1, 0, "a\n");
        put_part(12, grey, 1.0);
        put_product(7, 2, 0, "a\n");
        put_part(12, grey, 1.0);
        const size_t part = put_part(12, grey, 1.0);
        put_product(8, 1, 0, "a\n");
        put_part(12, grey, 1.0);
        put((const uint32_t[4]){0}, 16);
        memcpy(bytes + part + row[i].at, row[i].value, row[i].size);
        if (read_bodies(n_bytes) != SH_OK) fail_msg("row %zu: %s", i, err.text);
        assert_int_equal(bodies.n_wrong, 1);
        for (uint64_t id = 6; id <= 8; id++) {
            const struct ifc_body *body = ifc_bodies_find(&bodies, id);
            assert_int_equal(body->n_parts, id == 7 ? 0 : 1);
            assert_true((body->figures.area_m2 > 0.0) == (id != 7));
        }
        ifc_bodies_free(&bodies);
    }
}

static void results_that_are_wrong(void **state)
{
    (void)state;
    n_bytes = 0;
    put("shifc01", 8);
    put_product(7, 0, 0, "no line");
    put((const uint32_t[4]){0}, 16);
    refused("a text without a line end");
    n_bytes = 0;
    put("shifc01", 8);
    put((const uint32_t[4]){0, 1, 0, 0}, 16);
    refused("a product without a number");
    n_bytes = 0; /* the first two of three are the same */
    put("shifc01", 8);
    put_product(7, 0, 0, "a\n");
    put_product(9, 0, 0, "a\n");
    put_product(7, 0, 0, "a\n");
    put((const uint32_t[4]){0}, 16);
    refused("a product twice");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(products_by_number),
        cmocka_unit_test(figures_of_a_cube),
        cmocka_unit_test(results_that_are_cut),
        cmocka_unit_test(results_that_are_wrong),
        cmocka_unit_test(wrong_numbers_take_one_body_away),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
