/* Files that a command is to write: none may destroy another, or what is read. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "firmware_sim/app/app.h"

static int check(const char *scenario, const char *stats, const char *truth, struct sh_err *err)
{
    const struct app_input in = {.operand = {"run.yaml"}, .scenario = scenario};
    const struct app_output out[] = {{"stats", stats}, {"truth", truth}};
    memset(err, 0, sizeof *err);
    return app_check_outputs(&in, out, 2, err);
}

static void files_are_apart(void **state)
{
    (void)state;
    struct sh_err err;
    char folder[] = "/tmp/scanhead-test-XXXXXX";
    assert_non_null(mkdtemp(folder));
    assert_int_equal(chdir(folder), 0);
    assert_int_equal(check("lossy-udp", "a", "a", &err), SH_EINPUT); /* not there yet */
    assert_string_equal(err.text, "--truth a: is the file of --stats, too; allowed another file");
    assert_int_equal(check("lossy-udp", "a", "./a", &err), SH_EINPUT); /* two names of what is not there yet */
    assert_string_equal(err.text, "--truth ./a: is the file of --stats, too; allowed another file");
    char whole[sizeof folder + 8];
    snprintf(whole, sizeof whole, "%s/a", folder);
    assert_int_equal(check("lossy-udp", "sub/../a", whole, &err), SH_OK); /* no such folder: can't be made */
    assert_int_equal(mkdir("sub", 0700), 0);
    assert_int_equal(check("lossy-udp", "sub/../a", whole, &err), SH_EINPUT);
    assert_int_equal(check("lossy-udp", "sub/a", "a", &err), SH_OK);
    assert_int_equal(rmdir("sub"), 0);
    assert_int_equal(check("lossy-udp", "-", "-", &err), SH_OK); /* standard output */
    fclose(fopen("a", "w"));
    fclose(fopen("run.yaml", "w"));
    assert_int_equal(check(NULL, "a", "./a", &err), SH_EINPUT);
    assert_int_equal(check(NULL, NULL, "./run.yaml", &err), SH_EINPUT);
    assert_string_equal(err.text, "--truth ./run.yaml: is read, and would be overwritten; allowed another file");
    assert_int_equal(check("a", "./a", NULL, &err), SH_EINPUT);
    assert_int_equal(check("lossy-udp", "a", "b", &err), SH_OK);
    assert_int_equal(check(NULL, "/dev/null", "/dev/null", &err), SH_OK);
    assert_int_equal(check(NULL, NULL, NULL, &err), SH_OK);
    unlink("a");
    unlink("run.yaml");
    assert_int_equal(chdir("/"), 0);
    rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(files_are_apart)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
