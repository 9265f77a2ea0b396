/* SPDX-License-Identifier: MIT */
/* Replaces the tests of usbredir where its parser is missing: they are skipped, with the reason. */
#ifndef TESTS_UNIT_USBREDIR_MISSING_H
#define TESTS_UNIT_USBREDIR_MISSING_H

#include "tests/unit/link_test.h"

static void test_missing(void **state)
{
    (void)state;
    print_message("# needs libusbredirparser-dev\n");
    skip();
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_missing)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

#endif
