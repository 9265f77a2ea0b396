/* SPDX-License-Identifier: MIT */
/* A caster is made whole or not at all, whichever of its large parts there is no memory for. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <stdlib.h>
#include <string.h>

#include "core/cast.h"

static int n_asked, fails_at; /* the request that fails, from 1; 0: none */

void *aligned_alloc(size_t alignment, size_t size)
{
    void *memory;
    if (++n_asked == fails_at) return NULL;
    return posix_memalign(&memory, alignment, size) == 0 ? memory : NULL;
}

static int make(int at, struct caster **caster, struct sh_err *err)
{
    n_asked = 0;
    fails_at = at;
    const int rc = caster_create(caster, err);
    fails_at = 0;
    return rc;
}

static void a_caster_without_memory(void **state)
{
    (void)state;
    struct caster *caster;
    struct sh_err err;
    assert_int_equal(make(0, &caster, &err), SH_OK);
    caster_free(caster);
    const int n = n_asked;
    assert_true(n >= 2); /* the caster itself, and its rays across a beam */
    for (int at = 1; at <= n; at++) {
        err.text[0] = '\0';
        assert_int_equal(make(at, &caster, &err), SH_ENOMEM);
        assert_null(caster);
        assert_non_null(strstr(err.text, "no memory"));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_caster_without_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
