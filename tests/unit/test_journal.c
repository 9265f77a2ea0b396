/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "firmware_sim/device/journal.h"
#include "tests/common/free_fd.h"

static char dir[] = "/tmp/scanhead-journal-XXXXXX";
static char path[64];
static int fd_before;

static int make_dir(void **ctx)
{
    (void)ctx;
    fd_before = free_fd();
    if (mkdtemp(dir) == NULL) return -1;
    snprintf(path, sizeof path, "%s/j.txt", dir);
    return 0;
}

static int remove_dir(void **ctx)
{
    (void)ctx;
    unlink(path);
    return rmdir(dir) != 0 ? -1 : free_fd_check(fd_before);
}

static void write_text(const char *text, size_t len)
{
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    assert_int_equal(fwrite(text, 1, len, file), len);
    assert_int_equal(fclose(file), 0);
}

static void what_is_written_is_read(void **ctx)
{
    (void)ctx;
    static const struct journal_entry in[] = {
        {0, 0, 0, 2, "*RST"},
        {1, 1000000, 1, 3, "HEAD:PRR 1.2 MHZ"},
        {1, 1000000, 1, 4, "  scan:start  "},
        {UINT64_MAX, INT64_MAX, UINT32_MAX, 5, "SCAN:STOP"},
    };
    struct sh_err err = {0};
    struct journal *journal = journal_open(path, NULL, &err);
    assert_non_null(journal);
    for (size_t i = 0; i < 4; i++)
        assert_int_equal(journal_write(journal, in[i].tick, in[i].t_ns, in[i].session, in[i].line), 0);
    struct journal_entry *out;
    size_t n;
    assert_int_equal(journal_close(journal, &err), 0);
    assert_int_equal(journal_read(path, &out, &n, &err), 0);
    assert_int_equal(n, 4);
    for (size_t i = 0; i < 4; i++)
        assert_memory_equal(&out[i], &in[i], sizeof in[i]);
    free(out);
}

static void the_format_is_as_documented(void **ctx)
{
    (void)ctx;
    struct journal *journal = journal_open(path, NULL, NULL);
    assert_non_null(journal);
    assert_int_equal(journal_write(journal, 12, 12000000, 2, "HEAD:PRR 300000"), 0);
    assert_int_equal(journal_end(journal, 15, 15000000), 0);
    assert_int_equal(journal_close(journal, NULL), 0);
    char text[128] = "";
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    text[fread(text, 1, sizeof text - 1, file)] = '\0';
    fclose(file);
    assert_string_equal(text, "# scanhead journal 1\n12 12000000 2 HEAD:PRR 300000\n15 15000000 0 END\n");
    struct journal_entry *out;
    size_t n;
    assert_int_equal(journal_read(path, &out, &n, NULL), 0);
    assert_int_equal(n, 2);
    assert_false(journal_is_end(&out[0]));
    assert_true(journal_is_end(&out[1]) && out[1].tick == 15);
    out[1].session = 1; /* a client that sent it: a wrong command */
    assert_false(journal_is_end(&out[1]));
    free(out);
}

static void expect_unreadable(const char *text, size_t len, const char *why)
{
    struct sh_err err = {0};
    struct journal_entry *out;
    size_t n;
    write_text(text, len);
    assert_int_equal(journal_read(path, &out, &n, &err), SH_EINPUT);
    if (strstr(err.text, why) == NULL) fail_msg("%s, not '%s'", err.text, why);
    assert_null(strchr(err.text, '\n'));
}

/* Remarks may follow the end; commands and another end are refused, also those of earlier ticks. */
static void nothing_stands_after_the_end(void **ctx)
{
    (void)ctx;
    static const char *const after[] = {"500 500 1 SCAN:STAR", "300 300 1 SCAN:STAR", "400 400 0 END"};
    static const char ended[] = "# scanhead journal 1\n600 600 1 *RST\n400 400 0 END\n# a remark\n\n";
    char text[256];
    struct journal_entry *out;
    size_t n;
    write_text(ended, sizeof ended - 1);
    assert_int_equal(journal_read(path, &out, &n, NULL), 0);
    assert_true(n == 2 && journal_is_end(&out[0])); /* a head that ends still answers: such a line comes before END */
    free(out);
    for (size_t i = 0; i < sizeof after / sizeof *after; i++) {
        const int len = snprintf(text, sizeof text, "%s%s\n", ended, after[i]);
        expect_unreadable(text, (size_t)len, "j.txt:6: stands after END of line 3");
    }
}

static void sorted_by_tick_and_else_as_in_the_file(void **ctx)
{
    (void)ctx;
    static const char text[] = "# scanhead journal 1\n"
                               "# a note\n\n"
                               "5 5 1 a\n3 3 1 b\n5 5 2 c\n3 3 2 d\n1 1 1 e\n5 5 3 f\n";
    struct journal_entry *out;
    size_t n;
    write_text(text, sizeof text - 1);
    assert_int_equal(journal_read(path, &out, &n, NULL), 0);
    char order[16] = "";
    for (size_t i = 0; i < n; i++)
        strncat(order, out[i].line, 1);
    assert_string_equal(order, "ebdacf");
    free(out);
    write_text(text, 21);
    assert_int_equal(journal_read(path, &out, &n, NULL), 0);
    assert_int_equal(n, 0); /* a session without commands */
    free(out);
}

static void malformed_lines_are_named(void **ctx)
{
    (void)ctx;
    static const struct {
        const char *line, *why;
    } cases[] = {
        {"x 0 1 a", "a tick number"},
        {"-1 0 1 a", "a tick number"},
        {"+1 0 1 a", "a tick number"},
        {" 1 0 1 a", "a tick number"},
        {"1", "a tick number"},
        {"18446744073709551616 0 1 a", "a tick number"},
        {"1.5 0 1 a", "a tick number"},
        {"1\t0\t1\ta", "a tick number"},
        {"1  0 1 a", "a device time"},
        {"1 -5 1 a", "a device time"},
        {"1 9223372036854775808 1 a", "a device time"},
        {"1 1e3 1 a", "a device time"},
        {"1 0 4294967296 a", "a session number"},
        {"1 0 one a", "a session number"},
        {"1 0 1", "a session number"},
        {"1 0 1 ", "a command of"},
        {"1 0 1 a\r", "a command of"},
        {"1 0 1 \x80", "a command of"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char text[256], place[128];
        struct sh_err err = {0};
        struct journal_entry *out;
        size_t n;
        const int len = snprintf(text, sizeof text, "# scanhead journal 1\n1 0 1 ok\n%s\n", cases[i].line);
        write_text(text, (size_t)len);
        assert_int_equal(journal_read(path, &out, &n, &err), SH_EINPUT);
        assert_null(out);
        assert_int_equal(n, 0);
        snprintf(place, sizeof place, "%s:3: ", path);
        if (strstr(err.text, place) == NULL || strstr(err.text, cases[i].why) == NULL)
            fail_msg("'%s': %s", cases[i].line, err.text);
    }
}

static void what_is_no_journal_is_refused(void **ctx)
{
    (void)ctx;
    char line[COMMAND_MAX_LINE + 64];
    expect_unreadable("", 0, ":1: not a journal");
    expect_unreadable("\n", 1, ":1: not a journal");
    expect_unreadable("# scanhead journal 2\n", 21, ":1: not a journal");
    expect_unreadable("# scanhead journal 1", 20, ":1: the last line is cut");
    /* The crash of the writer in the middle of 300000. */
    expect_unreadable("# scanhead journal 1\n1 0 1 HEAD:PRR 3000", 40, ":2: the last line is cut");
    expect_unreadable("# scanhead journal 1\n1 0 1 a\0b\n", 31, ":2: a NUL byte");
    const int at = snprintf(line, sizeof line, "# scanhead journal 1\n1 0 1 ");
    memset(line + at, 'x', COMMAND_MAX_LINE + 1);
    line[at + COMMAND_MAX_LINE + 1] = '\n';
    expect_unreadable(line, (size_t)at + COMMAND_MAX_LINE + 2, ":2: there must be a command");
    struct sh_err err = {0};
    struct journal_entry *out;
    size_t n;
    assert_int_equal(journal_read("/nonexistent/j", &out, &n, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "/nonexistent/j: No such file"));
    assert_int_equal(journal_read("/tmp", &out, &n, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "/tmp: a directory, not a file"));
}

/* A file that has no end, or would wait for its writer, is refused as it is opened. */
static void what_is_no_file_is_refused_at_once(void **ctx)
{
    (void)ctx;
    char fifo[80];
    struct sh_err err = {0};
    struct journal_entry *out;
    size_t n;
    snprintf(fifo, sizeof fifo, "%s/fifo", dir);
    assert_int_equal(mkfifo(fifo, 0600), 0);
    assert_int_equal(journal_read(fifo, &out, &n, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "fifo: a FIFO, not a file"));
    unlink(fifo);
    assert_int_equal(journal_read("/dev/zero", &out, &n, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "/dev/zero: a device, not a file"));
}

/* A file of one line without an end takes no more memory than a line may have. */
static void a_line_is_bounded(void **ctx)
{
    (void)ctx;
    static char text[8192];
    memcpy(text, "# scanhead journal 1\n#", 22);
    memset(text + 22, 'x', sizeof text - 22);
    expect_unreadable(text, sizeof text, ":2: too long; allowed up to 1023 bytes a line");
    text[21 + 1023] = '\n';
    memset(text, 0, 1);
    expect_unreadable(text, sizeof text, ":1: a NUL byte");
}

/* The lines are in reverse, so that insertion would take the square of their number. */
static void the_order_of_the_file_costs_nothing(void **ctx)
{
    (void)ctx;
    enum { N = 50000 };
    char *text = malloc(N * 16 + 32), *at = text;
    struct journal_entry *out;
    size_t n;
    assert_non_null(text);
    at += sprintf(at, "# scanhead journal 1\n");
    for (int i = N; i > 0; i--)
        at += sprintf(at, "%d 0 1 a\n", i);
    write_text(text, (size_t)(at - text));
    free(text);
    assert_int_equal(journal_read(path, &out, &n, NULL), 0);
    assert_int_equal(n, N);
    for (size_t i = 0; i < n; i++)
        assert_int_equal(out[i].tick, i + 1);
    free(out);
}

static void a_journal_is_not_written_over_the_one_it_replays(void **ctx)
{
    (void)ctx;
    char other[80], around[128];
    struct sh_err err = {0};
    snprintf(other, sizeof other, "%s/other", dir);
    snprintf(around, sizeof around, "%s/../%s/j.txt", dir, dir + 5);
    write_text("# scanhead journal 1\n", 21);
    assert_int_equal(journal_check_paths(path, NULL, &err), SH_OK);
    assert_int_equal(journal_check_paths(NULL, path, &err), SH_OK);
    assert_int_equal(journal_check_paths(other, path, &err), SH_OK); /* not there yet */
    assert_int_equal(journal_check_paths(path, path, &err), SH_EINPUT);
    assert_int_equal(journal_check_paths(around, path, &err), SH_EINPUT);
    assert_int_equal(symlink("j.txt", other), 0);
    assert_int_equal(journal_check_paths(other, path, &err), SH_EINPUT);
    unlink(other);
    assert_int_equal(link(path, other), 0);
    assert_int_equal(journal_check_paths(other, path, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "is the journal to replay"));
    unlink(other);
}

/* Missing commands would change the later ones. */
static void a_journal_with_missing_commands_is_not_replayed(void **ctx)
{
    (void)ctx;
    static const char holed[] = "# scanhead journal 1\n1 0 1 a\nLOST 12\n9 0 1 b\n";
    static const char remarks[] = "# scanhead journal 1\n1 0 1 a\n# missing here: 12 remarks\n9 0 1 b\n";
    struct journal_entry *out;
    size_t n;
    expect_unreadable(holed, sizeof holed - 1, "j.txt:3: 12 commands are missing here");
    write_text(remarks, sizeof remarks - 1);
    assert_int_equal(journal_read(path, &out, &n, NULL), 0);
    assert_int_equal(n, 2);
    free(out);
}

static void the_writer_refuses_what_the_reader_would(void **ctx)
{
    (void)ctx;
    char line[COMMAND_MAX_LINE + 2];
    memset(line, 'x', sizeof line);
    line[COMMAND_MAX_LINE + 1] = '\0';
    struct journal *journal = journal_open(path, NULL, NULL);
    assert_non_null(journal);
    assert_int_equal(journal_write(journal, 0, -1, 0, "a"), SH_EINPUT);
    assert_int_equal(journal_write(journal, 0, 0, 0, ""), SH_EINPUT);
    assert_int_equal(journal_write(journal, 0, 0, 0, "a\n1 0 1 *RST"), SH_EINPUT);
    assert_int_equal(journal_write(journal, 0, 0, 0, line), SH_EINPUT);
    line[COMMAND_MAX_LINE] = '\0';
    assert_int_equal(journal_write(journal, 0, 0, 0, line), 0); /* and the longest goes through */
    assert_int_equal(journal_close(journal, NULL), 0);
    struct journal_entry *out;
    size_t n;
    assert_int_equal(journal_read(path, &out, &n, NULL), 0);
    assert_int_equal(n, 1);
    assert_string_equal(out[0].line, line);
    free(out);
}

static void a_full_disk_is_reported(void **ctx)
{
    (void)ctx;
    struct sh_err err = {0};
    assert_null(journal_open("/dev/full", NULL, &err));
    assert_int_equal(err.code, SH_EIO);
    assert_non_null(strstr(err.text, "/dev/full: No space left"));
    assert_null(journal_open("/nonexistent/j", NULL, &err));
    assert_non_null(strstr(err.text, "/nonexistent/j: cannot be opened for writing: No such file"));
    /* The first line does not fit whole: what fits is written, and then the reason is known. */
    struct rlimit all, few;
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &all), 0);
    few = all;
    few.rlim_cur = 4;
    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &few), 0);
    assert_null(journal_open(path, NULL, &err));
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &all), 0);
    assert_non_null(strstr(err.text, "j.txt: File too large"));
    /* The file may later grow to 100 bytes only, so the second of these lines does not fit. */
    struct rlimit before, small;
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    small = before;
    small.rlim_cur = 100;
    signal(SIGXFSZ, SIG_IGN);
    _Atomic uint64_t lost = 0;
    struct journal *journal = journal_open(path, &lost, &err);
    assert_non_null(journal);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &small), 0);
    static const char long_line[] = "HEAD:PRR 300000 ..............................................................";
    journal_write(journal, 1, 1, 1, long_line); /* the writing thread decides the fate of each */
    journal_write(journal, 2, 2, 1, long_line);
    const int closed = journal_close(journal, &err);
    setrlimit(RLIMIT_FSIZE, &before);
    signal(SIGXFSZ, SIG_DFL);
    assert_int_equal(closed, SH_EIO);
    assert_non_null(strstr(err.text, "j.txt: File too large"));
    assert_non_null(strstr(err.text, " lines are missing"));
    assert_true(lost > 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_written_is_read),
        cmocka_unit_test(the_format_is_as_documented),
        cmocka_unit_test(nothing_stands_after_the_end),
        cmocka_unit_test(sorted_by_tick_and_else_as_in_the_file),
        cmocka_unit_test(malformed_lines_are_named),
        cmocka_unit_test(what_is_no_journal_is_refused),
        cmocka_unit_test(what_is_no_file_is_refused_at_once),
        cmocka_unit_test(a_line_is_bounded),
        cmocka_unit_test(the_order_of_the_file_costs_nothing),
        cmocka_unit_test(a_journal_is_not_written_over_the_one_it_replays),
        cmocka_unit_test(a_journal_with_missing_commands_is_not_replayed),
        cmocka_unit_test(the_writer_refuses_what_the_reader_would),
        cmocka_unit_test(a_full_disk_is_reported),
    };
    return cmocka_run_group_tests_name("journal", tests, make_dir, remove_dir);
}
