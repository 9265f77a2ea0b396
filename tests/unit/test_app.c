/* SPDX-License-Identifier: MIT */
/* All commands share these: messages and exit statuses, endings of files, and files that a user names for output. */
#include "firmware_sim/app/app.h"

#include <errno.h>
#include <fcntl.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>
#include <cmocka.h>

#include "firmware_sim/app/csv_file.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/load.h"
#include "tests/unit/output_rig.h"

static struct output output;

static void expect_said(const char *want)
{
    char *said = output_give(&output);
    assert_string_equal(said, want);
    free(said);
}

/* ---- messages */

/* Wrong input is a matter of usage (2), all else is a failure (1). */
static void the_status_follows_from_the_error(void **state)
{
    (void)state;
    struct sh_err err;
    output_take(&output, stderr);
    sh_fail(&err, SH_EINPUT, "x.yaml: no");
    assert_int_equal(app_fail(&err), 2);
    sh_fail(&err, SH_EIO, "disk\tfull");
    assert_int_equal(app_fail(&err), 1);
    app_say("a\nb %d", 7);
    expect_said("scanhead: x.yaml: no\nscanhead: disk?full\nscanhead: a?b 7\n");
}

/* With more errors than are kept, the number of the others stands at the end. */
static void all_errors_of_a_configuration_are_printed(void **state)
{
    (void)state;
    static struct config_diagnostics d;
    static const struct {
        uint32_t n;
        const char *end;
    } rows[] = {{1, "scanhead: error 0\n"},
                {CONFIG_MAX_DIAGNOSTICS, "scanhead: error 19\n"},
                {CONFIG_MAX_DIAGNOSTICS + 1, "scanhead: error 19\nscanhead: and 1 more\n"}};
    for (int i = 0; i < CONFIG_MAX_DIAGNOSTICS; i++)
        sh_fail(&d.err[i], SH_EINPUT, "error %d", i);
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        d.n = rows[i].n;
        output_take(&output, stderr);
        const int status = app_fail_config(&d);
        char *said = output_give(&output);
        uint32_t lines = 0;
        for (const char *c = said; *c != '\0'; c++)
            lines += *c == '\n';
        assert_int_equal(status, APP_USAGE);
        assert_int_equal(lines, rows[i].n);
        const char *at = said;
        for (uint32_t k = 0; k < rows[i].n && k < CONFIG_MAX_DIAGNOSTICS; k++) {
            char line[32];
            const int len = snprintf(line, sizeof line, "scanhead: error %u\n", k);
            assert_int_equal(strncmp(at, line, (size_t)len), 0);
            at += len;
        }
        assert_string_equal(said + strlen(said) - strlen(rows[i].end), rows[i].end);
        free(said);
    }
}

/* The first failure counts. A second one is a warning, unless it says the same. */
static void a_second_failure_is_a_warning(void **state)
{
    (void)state;
    struct sh_err none = {0}, first, second, err;
    sh_fail(&first, SH_EIO, "first");
    sh_fail(&second, SH_ENOMEM, "second");
    output_take(&output, stderr);
    err = none;
    assert_int_equal(app_and_also(SH_OK, SH_OK, &none, &err), SH_OK);
    assert_int_equal(app_and_also(SH_OK, SH_ENOMEM, &second, &err), SH_ENOMEM);
    assert_string_equal(err.text, "second");
    err = first;
    assert_int_equal(app_and_also(SH_EIO, SH_OK, &none, &err), SH_EIO);
    assert_int_equal(app_and_also(SH_EIO, SH_EIO, &first, &err), SH_EIO);
    expect_said("");
    output_take(&output, stderr);
    assert_int_equal(app_and_also(SH_EIO, SH_ENOMEM, &second, &err), SH_EIO);
    assert_string_equal(err.text, "first");
    expect_said("scanhead: warning: second\n");
}

/* A warning that two parts give is printed once, with the first one's name. Without names each is printed. */
static void parts_warn_once(void **state)
{
    (void)state;
    output_take(&output, stderr);
    sh_warn(&app_report_stderr, "same");
    sh_warn(&app_report_stderr, "same");
    app_warn_of("station 1");
    sh_warn(&app_report_quiet, "same");
    sh_warn(&app_report_quiet, "other");
    app_warn_of("station 2");
    sh_warn(&app_report_stderr, "same");
    sh_warn(&app_report_stderr, "third");
    app_warn_of(NULL);
    expect_said("scanhead: warning: same\nscanhead: warning: same\nscanhead: warning: station 1: same\n"
                "scanhead: warning: station 1: other\nscanhead: warning: station 2: third\n");
}

/* Work whose length is not known has no share. */
static void progress_is_a_share(void **state)
{
    (void)state;
    output_take(&output, stderr);
    sh_progress(&app_report_stderr, "reading", -1.0);
    sh_progress(&app_report_stderr, "planning", 0.0);
    sh_progress(&app_report_quiet, "hidden", 0.5);
    sh_progress(&app_report_seconds, "short", 0.5); /* within the first second */
    expect_said("scanhead: reading ...\nscanhead: planning: 0 %\n");
}

static void what_was_left_out_is_a_warning_each(void **state)
{
    (void)state;
    output_take(&output, stderr);
    app_warn_left_out(0, 0, 0);
    app_warn_empty(0, 0, 5);
    app_warn_empty(10, 11, 5); /* a damaged stream */
    expect_said("");
    output_take(&output, stderr);
    app_warn_left_out(0, 1, 0);
    expect_said("scanhead: warning: 1 echoes left out, too far from the anchor for the stream's integers\n");
}

static void a_settings_file_without_effect_is_a_warning(void **state)
{
    (void)state;
    struct config *cfg = calloc(1, sizeof *cfg);
    char path[] = "/tmp/scanhead-app-XXXXXX", want[128];
    assert_non_null(cfg);
    const int fd = mkstemp(path);
    assert_true(fd >= 0);
    output_take(&output, stderr);
    app_warn_settings_file(cfg, "why");
    strcpy(cfg->head.settings_file, path);
    app_warn_settings_file(cfg, "why"); /* nothing is stored there */
    assert_int_equal(write(fd, "x", 1), 1);
    app_warn_settings_file(cfg, "why");
    snprintf(want, sizeof want, "scanhead: warning: head.settings_file %s: is not used: why\n", path);
    expect_said(want);
    close(fd);
    unlink(path);
    free(cfg);
}

/* ---- files */

static void endings_have_something_before_them(void **state)
{
    (void)state;
    assert_true(app_ends_in("a.ply", ".ply") && app_ends_in("A.PLY", ".ply"));
    assert_false(app_ends_in(".ply", ".ply") || app_ends_in("ply", ".ply") || app_ends_in("a.ply2", ".ply"));
    assert_true(app_is_recording("a.shs") && app_is_recording("a.pcapng"));
    assert_false(app_is_recording("a.pcap") || app_is_recording(".shs"));
}

static void put_one(struct json *json, const void *ctx)
{
    json_int(json, NULL, *(const int *)ctx);
}

static void put_none(struct json *json, const void *ctx)
{
    (void)json, (void)ctx;
}

/* The first error in writing is the result, and its text begins with the path. */
static void json_goes_to_a_file(void **state)
{
    (void)state;
    static const int seven = 7;
    char path[] = "/tmp/scanhead-app-XXXXXX", text[16] = "";
    struct sh_err err = {0};
    close(mkstemp(path));
    unlink(path);
    assert_int_equal(app_write_json(path, put_one, &seven, &err), SH_OK);
    FILE *f = fopen(path, "r");
    assert_non_null(f);
    assert_int_equal(fread(text, 1, sizeof text - 1, f), 2);
    assert_string_equal(text, "7\n");
    fclose(f);
    unlink(path);
    assert_int_equal(app_write_json(path, put_none, NULL, &err), SH_ESTATE);
    assert_int_equal(strncmp(err.text, path, strlen(path)), 0);
    unlink(path);
    output_take(&output, stdout);
    assert_int_equal(app_write_json("-", put_one, &seven, &err), SH_OK);
    expect_said("7\n");
    assert_int_equal(app_write_json("/nowhere/x.json", put_one, &seven, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "/nowhere/x.json: "));
}

static void put_texts(FILE *out, const void *ctx)
{
    for (const char *const *text = ctx; *text != NULL; text++) {
        csv_file_put_text(out, *text);
        putc('|', out);
    }
}

/* RFC 4180: a field with a comma, a quote or a line end is quoted, and its quotes are doubled. */
static void csv_fields_are_quoted_where_they_must_be(void **state)
{
    (void)state;
    static const char *const texts[] = {"", "plain", "a,b", "a\"b", "a\nb", "a\rb", "\"", NULL};
    struct sh_err err;
    output_take(&output, stdout);
    assert_int_equal(app_write_file("-", put_texts, texts, &err), SH_OK);
    expect_said("|plain|\"a,b\"|\"a\"\"b\"|\"a\nb\"|\"a\rb\"|\"\"\"\"|");
}

/* Shares of red, green and blue in their order, each of 255. */
static void a_colour_is_three_octets(void **state)
{
    (void)state;
    char text[CSV_FILE_COLOUR_LEN];
    struct scene_surface s = {.has_colour = 1, .colour = {1.0f, 0.5f, 0.0f}};
    assert_string_equal(csv_file_colour(&s, text), "#ff8000"); /* 127.5 is rounded up */
    s.colour[2] = 16.0f / 255.0f;
    assert_string_equal(csv_file_colour(&s, text), "#ff8010");
    s.has_colour = 0;
    assert_string_equal(csv_file_colour(&s, text), "");
}

/* A descriptor of its own is closed; 0 stands for none; standard error stays open. */
static void a_ready_line_goes_to_its_descriptor(void **state)
{
    (void)state;
    static const int seven = 7;
    struct sh_err err = {0};
    char text[16] = "";
    int fd[2];
    assert_int_equal(app_say_ready(0, put_one, &seven, &err), SH_OK);
    assert_int_equal(pipe(fd), 0);
    assert_int_equal(app_say_ready(fd[1], put_one, &seven, &err), SH_OK);
    assert_int_equal(read(fd[0], text, sizeof text), 2);
    assert_string_equal(text, "7\n");
    assert_int_equal(read(fd[0], text, sizeof text), 0);
    close(fd[0]);
    output_take(&output, stderr);
    assert_int_equal(app_say_ready(STDERR_FILENO, put_one, &seven, &err), SH_OK);
    app_say("still there");
    expect_said("7\nscanhead: still there\n");
    assert_int_equal(app_say_ready(9999, put_one, &seven, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "--ready-fd 9999: "));
}

/* ctx: whether the text is written at once. */
static void put_text(FILE *out, const void *ctx)
{
    const int *early = ctx;
    assert_null(app_write_failure(out));
    fputs("text", out);
    if (*early) fflush(out);
    errno = 0;
}

/* The reason of an early failure, which stdio has forgotten by the end, is found again. */
static void a_full_disk_is_the_reason(void **state)
{
    struct sh_err err = {0};
    (void)state;
    for (int early = 0; early < 2; early++) {
        assert_int_equal(app_write_file("/dev/full", put_text, &early, &err), SH_EIO);
        assert_string_equal(err.text, "/dev/full: No space left on device");
    }
    assert_int_equal(app_write_json("/dev/full", put_one, &(int){7}, &err), SH_EIO);
    assert_string_equal(err.text, "/dev/full: No space left on device");
    const int fd = open("/dev/full", O_WRONLY | O_CLOEXEC);
    assert_int_equal(app_say_ready(fd, put_one, &(int){7}, &err), SH_EIO);
    assert_non_null(strstr(err.text, ": No space left on device"));
}

/* Without a free descriptor, one of its own gets the line all the same. A standard stream, which needs another, has the
 * system's reason, and the user's command was right. */
static void a_ready_line_without_a_free_descriptor(void **state)
{
    static const int seven = 7;
    struct sh_err err = {0};
    struct rlimit before, none;
    int fd[2];
    (void)state;
    assert_int_equal(pipe(fd), 0);
    assert_int_equal(getrlimit(RLIMIT_NOFILE, &before), 0);
    none = before;
    none.rlim_cur = 0;
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &none), 0);
    const int to_stderr = app_say_ready(STDERR_FILENO, put_one, &seven, &err);
    const int to_own = app_say_ready(fd[1], put_one, &seven, NULL);
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &before), 0);
    assert_true(to_own == SH_OK && to_stderr == SH_EIO);
    assert_string_equal(err.text, "--ready-fd 2: Too many open files");
    close(fd[0]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_status_follows_from_the_error),
        cmocka_unit_test(all_errors_of_a_configuration_are_printed),
        cmocka_unit_test(a_second_failure_is_a_warning),
        cmocka_unit_test(parts_warn_once),
        cmocka_unit_test(progress_is_a_share),
        cmocka_unit_test(what_was_left_out_is_a_warning_each),
        cmocka_unit_test(a_settings_file_without_effect_is_a_warning),
        cmocka_unit_test(endings_have_something_before_them),
        cmocka_unit_test(json_goes_to_a_file),
        cmocka_unit_test(csv_fields_are_quoted_where_they_must_be),
        cmocka_unit_test(a_colour_is_three_octets),
        cmocka_unit_test(a_ready_line_goes_to_its_descriptor),
        cmocka_unit_test(a_ready_line_without_a_free_descriptor),
        cmocka_unit_test(a_full_disk_is_the_reason),
    };
    return cmocka_run_group_tests_name("app", tests, NULL, NULL);
}
