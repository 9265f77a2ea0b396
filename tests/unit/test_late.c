/* SPDX-License-Identifier: MIT */
/* Each library that is loaded late is found, and a call that it lacks is reported. */
#include <dlfcn.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <sys/resource.h>
#include <cmocka.h>

#include "core/late.h"

#ifndef SH_SANITIZE            /* which needs dlopen and more memory itself */
static const char *fails_with; /* NULL: libraries are loaded */

/* The product's calls come here. */
void *dlopen(const char *file, int flags)
{
    void *(*real)(const char *, int) = NULL;
    void *found = dlsym(RTLD_NEXT, "dlopen");
    memcpy(&real, &found, sizeof real);
    return fails_with == NULL ? real(file, flags) : NULL;
}

char *dlerror(void)
{
    return (char *)(uintptr_t)fails_with;
}

/* The words are those of glibc. "failed to map" is a lack of memory only where there is none, as under a limit. */
static void a_lack_of_memory_is_its_own_error(void **state)
{
    (void)state;
    static const struct {
        const char *why;
        int limited, code;
    } rows[] = {{"libcrypto.so.3: failed to map segment from shared object", 1, SH_ENOMEM},
                {"libcrypto.so.3: failed to map segment from shared object", 0, SH_EINPUT},
                {"libx.so: cannot create shared object descriptor: Cannot allocate memory", 0, SH_ENOMEM},
                {"libx.so: cannot open shared object file: No such file or directory", 1, SH_EINPUT}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct rlimit was, low;
        struct sh_err err = {0};
        assert_int_equal(getrlimit(RLIMIT_AS, &was), 0);
        low = (struct rlimit){rows[i].limited ? 1 : was.rlim_cur, was.rlim_max};
        fails_with = rows[i].why;
        setrlimit(RLIMIT_AS, &low);
        const int rc = late_load(LATE_websockets, NULL, NULL, 0, &err);
        setrlimit(RLIMIT_AS, &was);
        fails_with = NULL;
        assert_int_equal(rc, rows[i].code);
        assert_non_null(strstr(err.text, rows[i].why));
    }
}
#endif

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
#ifndef SH_SANITIZE
        cmocka_unit_test(a_lack_of_memory_is_its_own_error),
#endif
        cmocka_unit_test(each_is_there),
        cmocka_unit_test(a_call_that_is_not_there),
    };
    return cmocka_run_group_tests_name("late", tests, NULL, NULL);
}
