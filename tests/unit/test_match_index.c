/* SPDX-License-Identifier: MIT */
/* The index of the places of points, against a search through all of them: places that are the same, places that agree
 * to within a distance, and groups. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "firmware_sim/app/studio/verdict/match_index.h"

enum { N = 240, SAME = 40 };

static struct match_entry entry[N];
static struct match_index index_of;

/* Numbers that look random, from 0 to below 1. */
static double next(void)
{
    static uint32_t x = 1;
    x = x * 1664525u + 1013904223u;
    return x / 0x1p32;
}

/* Places in a cube of 2 m around 0; the last SAME places repeat the first ones. */
static void make(void)
{
    memset(entry, 0, sizeof entry);
    for (int i = 0; i < N; i++) {
        for (int k = 0; k < 3; k++)
            entry[i].p[k] = i < N - SAME ? 2.0 * next() - 1.0 : entry[i - (N - SAME)].p[k];
        entry[i].sent = i < N - SAME ? 1 : 10;
        entry[i].got = 99;
    }
    index_of = (struct match_index){.entry = entry, .n = N, .within_m = 0.125};
    match_index_make(&index_of);
}

static void same_places_are_one(void **state)
{
    uint32_t sent = 0, twice = 0;
    (void)state;
    make();
    assert_int_equal(index_of.n, N - SAME);
    for (size_t i = 0; i < index_of.n; i++) {
        sent += entry[i].sent;
        twice += entry[i].sent == 11;
        assert_true(entry[i].got == 0 && entry[i].parent == i);
        for (int k = 0; k < 3; k++) {
            assert_true(entry[i].p[k] >= index_of.least[k] && entry[i].p[k] <= index_of.most[k]);
            assert_int_equal(entry[i].cell[k], (int64_t)floor(entry[i].p[k] / 0.25));
        }
        for (size_t j = 0; j < i; j++)
            assert_true(memcmp(entry[i].p, entry[j].p, sizeof entry[i].p) != 0);
    }
    assert_int_equal(sent, N - SAME + 10 * SAME);
    assert_int_equal(twice, SAME);
}

static int hits[N];

static void count_hit(void *ctx, size_t i)
{
    assert_ptr_equal(ctx, hits);
    hits[i]++;
}

static int agrees(const double a[3], const double b[3])
{
    return fabs(a[0] - b[0]) <= 0.125 && fabs(a[1] - b[1]) <= 0.125 && fabs(a[2] - b[2]) <= 0.125;
}

static void near_places_are_found(void **state)
{
    size_t found = 0;
    (void)state;
    make();
    for (int t = 0; t < 400; t++) {
        double p[3];
        size_t want = 0;
        for (int k = 0; k < 3; k++)
            p[k] = t < 200 ? entry[t].p[k] + (t % 3 == k ? 0.125 : 0.0) : 3.0 * next() - 1.5;
        memset(hits, 0, sizeof hits);
        const size_t n = match_index_near(&index_of, p, count_hit, hits);
        for (size_t i = 0; i < index_of.n; i++) {
            assert_int_equal(hits[i], agrees(entry[i].p, p));
            want += (size_t)agrees(entry[i].p, p);
        }
        assert_int_equal(n, want);
        assert_int_equal(match_index_near(&index_of, p, NULL, NULL), want);
        found += n;
    }
    assert_true(found > 200);
    assert_int_equal(match_index_near(&index_of, (const double[3]){1e300, 0, 0}, NULL, NULL), 0);
    assert_int_equal(match_index_near(&index_of, (const double[3]){NAN, 0, 0}, NULL, NULL), 0);
}

/* The root of a group has the sums of all its members. */
static void groups_add_up(void **state)
{
    (void)state;
    make();
    const uint32_t sent = entry[3].sent + entry[5].sent + entry[7].sent + entry[9].sent;
    for (int i = 3; i <= 9; i += 2)
        entry[i].got = (uint32_t)i;
    match_index_join(&index_of, 3, 5);
    match_index_join(&index_of, 7, 9);
    assert_true(match_index_root(&index_of, 3) == match_index_root(&index_of, 5));
    assert_true(match_index_root(&index_of, 3) != match_index_root(&index_of, 7));
    match_index_join(&index_of, 9, 5);
    match_index_join(&index_of, 3, 7); /* they are one already */
    const size_t root = match_index_root(&index_of, 3);
    for (size_t i = 3; i <= 9; i += 2)
        assert_int_equal(match_index_root(&index_of, i), root);
    assert_true(entry[root].sent == sent && entry[root].got == 3 + 5 + 7 + 9);
    assert_int_equal(match_index_root(&index_of, 4), 4);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(same_places_are_one),
        cmocka_unit_test(near_places_are_found),
        cmocka_unit_test(groups_add_up),
    };
    return cmocka_run_group_tests_name("match index", tests, NULL, NULL);
}
