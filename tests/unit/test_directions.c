/* SPDX-License-Identifier: MIT */
/* Lists of directions: angles of each row, and the limits, which are allowed themselves. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "core/emitter.h"
#include "tests/unit/file_rig.h"

static struct emitter_firing *direction;
static uint32_t n_directions;
static struct sh_err err;

static int read_list(const char *text)
{
    FILE *f = fopen(file_path, "w");
    assert_non_null(f);
    fputs(text, f);
    assert_int_equal(fclose(f), 0);
    direction = (struct emitter_firing *)&err; /* an error must replace this pointer */
    return emitter_read_directions(file_path, &direction, &n_directions, &err);
}

static void expect_list(const char *text, uint32_t n, const double (*azimuth_elevation_deg)[2])
{
    if (read_list(text) != SH_OK) fail_msg("%s", err.text);
    assert_int_equal(n_directions, n);
    for (uint32_t i = 0; i < n; i++) {
        const double *want = azimuth_elevation_deg[i];
        assert_int_equal(direction[i].tick, i);
        /* Roundings of some parts of a turn. */
        if (!(fabs(360.0 * direction[i].pan_turn - want[0]) < 1e-13 * 360.0 &&
              fabs(360.0 * direction[i].mirror_turn - want[1]) < 1e-13 * 360.0))
            fail_msg("row %u: %.17g %.17g", i, 360.0 * direction[i].pan_turn, 360.0 * direction[i].mirror_turn);
    }
    free(direction);
}

/* Azimuth counts from y to x, elevation from the plane of both to z. A vector's length does not matter. */
static void rows_have_their_angles(void **state)
{
    (void)state;
    static const double vectors[][2] = {{0, 0},    {90, 0},     {180, 0},  {-90, 0},
                                        {0, 90},   {0, -90},    {45, 45},  {135, -45},
                                        {-45, 45}, {-135, -45}, {30, -30}, {0, 1e-7 * 180 / M_PI}};
    expect_list("0 2 0\n3 0 0\n0 -1 0\n-1e9 0 0\n0 0 1e-9\n0 0 -7\n1 1 1.41421356237309505\n"
                "2 -2 -2.8284271247461901\n-1 1 1.41421356237309505\n-1 -1 -1.41421356237309505\n"
                "0.5 0.86602540378443865 -0.57735026918962576\n0 1e7 1\n",
                12, vectors);
    static const double angles[][2] = {{0, 90}, {360, -90}, {-360, 0}, {12.5, -33.25}, {0.000001, 89.999999}};
    expect_list("# azimuth elevation\n0 90 # up\n360\t-90\n\n -360 0\n12.5 -33.25\r\n1e-6 89.999999", 5, angles);
}

static void an_error_leaves_no_list(void **state)
{
    (void)state;
    static const struct {
        const char *text, *says;
    } wrong[] = {
        {"0 90\n0 90.0000001\n", ", line 2: an elevation of 90.0000001 deg; allowed -90 to 90"},
        {"0 -90.0000001\n", ", line 1: an elevation of -90.0000001 deg; allowed -90 to 90"},
        {"360.0000001 0\n", ", line 1: an azimuth of 360.0000001 deg; allowed -360 to 360"},
        {"-360.0000001 0\n", ", line 1: an azimuth of -360.0000001 deg; allowed -360 to 360"},
        {"0 0 1\n0 0 0\n", ", line 2: 0 0 0 is no direction; allowed any other x y z"},
        {"1 2 3\n1\n", ", line 2: a row with 1 number; allowed 3, x y z, in each row"},
        {"1 2 3\n1 inf 2\n", ", line 2: not a direction; allowed are x y z, or azimuth and elevation in degrees"}};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        assert_int_equal(read_list(wrong[i].text), SH_EINPUT);
        assert_null(direction);
        const size_t n = strlen(file_path);
        if (strncmp(err.text, file_path, n) != 0 || strcmp(err.text + n, wrong[i].says) != 0) fail_msg("%s", err.text);
    }
}

/* A million rows are allowed, and no more. */
static void a_list_has_a_limit(void **state)
{
    (void)state;
    char *text = malloc(4 * (EMITTER_MAX_STEPS + 1) + 1), *p = text;
    assert_non_null(text);
    for (int i = 0; i <= EMITTER_MAX_STEPS; i++, p += 4)
        memcpy(p, "1 2\n", 5);
    assert_int_equal(read_list(text), SH_EINPUT);
    assert_null(direction);
    assert_non_null(strstr(err.text, ", line 1000001: too many directions; allowed up to 1000000"));
    text[4 * EMITTER_MAX_STEPS] = '\0';
    assert_int_equal(read_list(text), SH_OK);
    assert_int_equal(n_directions, EMITTER_MAX_STEPS);
    assert_int_equal(direction[EMITTER_MAX_STEPS - 1].tick, EMITTER_MAX_STEPS - 1);
    free(direction);
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rows_have_their_angles),
        cmocka_unit_test(an_error_leaves_no_list),
        cmocka_unit_test(a_list_has_a_limit),
    };
    return cmocka_run_group_tests_name("directions", tests, make_file, remove_file);
}
