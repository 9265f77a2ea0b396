/* SPDX-License-Identifier: MIT */
/* Distances of words against their definition: the fewest letters to insert, delete or replace. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#include "firmware_sim/base/nearest.h"

static size_t least(size_t a, size_t b)
{
    return a < b ? a : b;
}

/* Tries all ways from one word to the other. */
static size_t by_definition(const char *a, const char *b)
{
    if (*a == '\0') return strlen(b);
    if (*b == '\0') return strlen(a);
    const size_t same = by_definition(a + 1, b + 1) + (*a != *b);
    return least(same, 1 + least(by_definition(a + 1, b), by_definition(a, b + 1)));
}

/* All pairs of words of up to four letters from an alphabet of two. */
static void distances_are_those_of_the_definition(void **state)
{
    (void)state;
    enum { WORDS = 31 };
    char word[WORDS][5];
    int n = 0;
    for (int len = 0; len <= 4; len++)
        for (int k = 0; k < 1 << len; k++, n++) {
            for (int i = 0; i < len; i++)
                word[n][i] = (char)('a' + (k >> i & 1));
            word[n][len] = '\0';
        }
    assert_int_equal(n, WORDS);
    for (int i = 0; i < n; i++)
        for (int k = 0; k < n; k++)
            assert_int_equal(nearest_distance(word[i], word[k]), by_definition(word[i], word[k]));
    assert_int_equal(nearest_distance("kitten", "sitting"), 3);
}

static void words_have_a_longest_length(void **state)
{
    (void)state;
    char most[NEAREST_MAX], more[NEAREST_MAX + 1];
    memset(most, 'a', sizeof most - 1);
    most[sizeof most - 1] = '\0';
    memset(more, 'a', sizeof more - 1);
    more[sizeof more - 1] = '\0';
    assert_int_equal(nearest_distance(most, most), 0);
    assert_int_equal(nearest_distance(most, "a"), NEAREST_MAX - 2);
    assert_int_equal(nearest_distance("a", most), NEAREST_MAX - 2);
    assert_int_equal(nearest_distance(more, most), NEAREST_MAX);
    assert_int_equal(nearest_distance(most, more), NEAREST_MAX);
}

static void near_words_are_meant(void **state)
{
    (void)state;
    static const struct {
        const char *word, *known;
        int near;
    } rows[] = {
        {"scan", "scan", 1},   {"scna", "scan", 1},   {"scanhead", "scan", 1}, {"sca", "scanhead", 1},
        {"sc", "scanhead", 0}, {"scanhead", "sc", 0}, {"can", "scan", 1},      {"naaa", "scan", 0},
        {"ab", "cd", 0},       {"ab", "ac", 1},       {"abc", "xyc", 1},       {"abc", "xyz", 0},
        {"a", "b", 0},         {"", "a", 0},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        if (nearest_is_near(rows[i].word, rows[i].known) != rows[i].near)
            fail_msg("%s, %s", rows[i].word, rows[i].known);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(distances_are_those_of_the_definition),
        cmocka_unit_test(words_have_a_longest_length),
        cmocka_unit_test(near_words_are_meant),
    };
    return cmocka_run_group_tests_name("nearest words", tests, NULL, NULL);
}
