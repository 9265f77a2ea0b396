/* SPDX-License-Identifier: MIT */
/* Configurations that are made to cost much: anchors without end, lists that name each other, a document within itself.
 * A limit refuses each of them, with its line, long before it costs anything. test_config has depth and size. */
#include "firmware_sim/config/load.h"
#include "tests/unit/config_rig.h"

enum { MOST_ANCHORS = 256 };

/* Loads a list of n elements, each with an anchor. */
static void load_anchors(int n)
{
    char *text = malloc(64 * (size_t)n + 64), *p = text;
    assert_non_null(text);
    p += sprintf(p, "links: [");
    for (int i = 0; i < n; i++)
        p += sprintf(p, "\n&a%d x,", i);
    sprintf(p, "]\n");
    assert_int_equal(load_text(text), SH_EINPUT);
    free(text);
}

static void anchors_have_a_limit(void **state)
{
    (void)state;
    load_anchors(MOST_ANCHORS);
    assert_null(strstr(err.text, "anchors"));
    load_anchors(MOST_ANCHORS + 1);
    assert_says(":258: too many anchors; allowed 256");
}

/* Nine lists name the one before ten times each: that would be 10^10 elements. */
static void lists_of_lists_are_not_followed(void **state)
{
    (void)state;
    char text[4096], *p = text;
    p += sprintf(p, "scene:\n  meshes: &a0 [x, x, x, x, x, x, x, x, x, x]\n");
    for (int i = 1; i < 10; i++) {
        p += sprintf(p, "k%d: &a%d [", i, i);
        for (int j = 0; j < 10; j++)
            p += sprintf(p, "%s*a%d", j == 0 ? "" : ", ", i - 1);
        p += sprintf(p, "]\n");
    }
    sprintf(p, "links: *a9\n");
    assert_int_equal(load_text(text), SH_EINPUT);
    assert_true(diagnostics.n <= 200); /* a line for each wrong element, not for each way to it */
}

static void a_document_within_itself_ends(void **state)
{
    (void)state;
    static const char *const texts[] = {"&a [*a]\n", "links: &a\n  - *a\n", "head: &a {noise: *a}\n",
                                        "&a {scene: *a}\n", "stations: &a [*a, *a]\n"};
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++) {
        assert_int_equal(load_text(texts[i]), SH_EINPUT);
        assert_non_null(strstr(err.text, ".yaml"));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(anchors_have_a_limit),
        cmocka_unit_test(lists_of_lists_are_not_followed),
        cmocka_unit_test(a_document_within_itself_ends),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
