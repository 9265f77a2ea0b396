/* SPDX-License-Identifier: MIT */
/* libscanhead where there is no memory for the name of a surface: the call says so, nothing leaks, earlier names stay,
 * and names that come again are taken. */
#include "tests/unit/host_rig.h"

static int n_asked, fails_at; /* the copy of a text that fails, from 1; 0: none */

char *strdup(const char *text)
{
    if (++n_asked == fails_at) return NULL;
    char *copy = malloc(strlen(text) + 1);
    return copy != NULL ? strcpy(copy, text) : NULL;
}

static void name_of(void *ctx, uint32_t i, const char **object, const char **material)
{
    const char *const(*names)[2] = ctx;
    *object = names[i][0];
    *material = names[i][1];
}

static int take(struct scanhead *sh, int head, const char *const (*names)[2])
{
    struct native_names labels = {0, 2, name_of, (void *)(uintptr_t)names};
    struct scanhead_frame f;
    const size_t len = native_encode_surfaces(out, sizeof out, 4096, &labels, 1);
    native_finish_frame(out, rig_next_seq());
    put_all(head, out, len);
    n_asked = 0;
    return scanhead_next(sh, &f, WAIT_MS);
}

static void expect(const struct scanhead *sh, uint32_t i, const char *const names[2])
{
    const char *object, *material;
    assert_int_equal(scanhead_surface(sh, i, &object, &material), 1);
    assert_string_equal(object, names[0]);
    assert_string_equal(material, names[1]);
}

/* The first and second copies are of the first surface, the others of the second one. */
static void no_memory_for_a_name(void **state)
{
    static const char *const was[][2] = {{"wall", "brick"}, {"door", "oak"}};
    static const char *const is[][2] = {{"fence", "wire"}, {"gate", "iron"}};
    (void)state;
    for (int at = 1; at <= 4; at++) {
        int head;
        struct scanhead *sh = open_pair(&head);
        assert_int_equal(take(sh, head, was), SCANHEAD_OK);
        fails_at = at;
        assert_int_equal(take(sh, head, is), SCANHEAD_ENOMEM);
        fails_at = 0;
        assert_non_null(strstr(scanhead_error(sh), at <= 2 ? "no memory for 1 surface" : "no memory for 2 surface"));
        if (at <= 2) expect(sh, 0, was[0]);
        if (at > 2) expect(sh, 1, was[1]);
        assert_int_equal(take(sh, head, is), SCANHEAD_OK);
        expect(sh, 0, is[0]);
        expect(sh, 1, is[1]);
        close(head);
        scanhead_close(sh);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_memory_for_a_name),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
