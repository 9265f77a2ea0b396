/* SPDX-License-Identifier: MIT */
/* Each library that is loaded late is found, and a call that it lacks is reported. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "core/late.h"

static void each_is_there(void **state)
{
    (void)state;
    static const char *const call[] = {[LATE_proj] = "proj_context_create",
                                       [LATE_assimp] = "aiGetErrorString",
                                       [LATE_tiff] = "TIFFGetVersion",
                                       [LATE_websockets] = "lws_get_library_version"};
    for (int i = 0; i < 4; i++) {
        void (*found)(void) = NULL;
        struct sh_err err = {0};
        if (late_load((enum late_library)i, &call[i], &found, 1, &err) != SH_OK) fail_msg("%s", err.text);
        assert_true(found != NULL);
    }
}

static void a_call_that_is_not_there(void **state)
{
    (void)state;
    static const char *const call[] = {"TIFFGetVersion", "TIFFNeverCalledSo"};
    void (*found[2])(void) = {NULL, NULL};
    struct sh_err err = {0};
    assert_int_equal(late_load(LATE_tiff, call, found, 2, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "lacks the function TIFFNeverCalledSo"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_is_there),
        cmocka_unit_test(a_call_that_is_not_there),
    };
    return cmocka_run_group_tests_name("late", tests, NULL, NULL);
}
