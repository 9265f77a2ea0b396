/* SPDX-License-Identifier: MIT */
/* The file of stored settings. Its bytes are those of the picture in settings_file.h, written out here. */
#include <sched.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <cmocka.h>

#include "firmware_sim/device/settings_file.h"
#include "tests/common/free_fd.h"

static char dir[] = "/tmp/test_settings_XXXXXX", path[64], part[64], inner[64];
static struct sh_err err;
static int fd_before;

static void write_text(const char *text)
{
    FILE *out = fopen(path, "w");
    assert_non_null(out);
    fputs(text, out);
    assert_int_equal(fclose(out), 0);
}

static void expect_text(const char *want)
{
    char text[4096] = "";
    FILE *in = fopen(path, "r");
    assert_non_null(in);
    text[fread(text, 1, sizeof text - 1, in)] = '\0';
    fclose(in);
    assert_string_equal(text, want);
}

static struct settings_file *open_file(void)
{
    struct settings_file *file;
    if (settings_file_open(path, "puck", NULL, &file, &err) != SH_OK) fail_msg("%s", err.text);
    return file;
}

static void close_file(struct settings_file *file)
{
    if (settings_file_close(file, &err) != SH_OK) fail_msg("%s", err.text);
}

static void expect_stored(struct settings_file *file, const char *name, const char *want)
{
    char text[SETTINGS_FILE_TEXT];
    settings_file_get(file, name, text);
    assert_string_equal(text, want);
}

static void begin(void)
{
    unlink(path);
}

static void what_is_stored_is_there_again(void **state)
{
    (void)state;
    begin();
    struct settings_file *file = open_file();
    expect_stored(file, "head", "");
    assert_int_equal(settings_file_put(file, "head", "HEAD:LINes 15\nSCAN:ECHoes LAST\n"), SH_OK);
    assert_int_equal(settings_file_put(file, "cola", "name=north gate\n"), SH_OK);
    expect_stored(file, "head", "HEAD:LINes 15\nSCAN:ECHoes LAST\n");
    close_file(file);
    expect_text("scanhead settings 1\nprofile puck\nhead HEAD:LINes 15\nhead SCAN:ECHoes LAST\ncola name=north gate\n"
                "end\n");
    assert_int_equal(access(part, F_OK), -1);
    file = open_file();
    expect_stored(file, "head", "HEAD:LINes 15\nSCAN:ECHoes LAST\n");
    expect_stored(file, "cola", "name=north gate\n");
    assert_int_equal(settings_file_put(file, "head", ""), SH_OK);
    close_file(file);
    expect_text("scanhead settings 1\nprofile puck\ncola name=north gate\nend\n");
}

/* A head that stores nothing leaves the file's bytes and its inode. */
static void nothing_new_is_not_written(void **state)
{
    (void)state;
    struct stat before, after;
    begin();
    write_text("scanhead settings 1\nprofile puck\nhead HEAD:LINes 15\nend\n");
    assert_int_equal(stat(path, &before), 0);
    struct settings_file *file = open_file();
    assert_int_equal(settings_file_put(file, "head", "HEAD:LINes 15\n"), SH_OK);
    close_file(file);
    assert_int_equal(stat(path, &after), 0);
    assert_true(before.st_ino == after.st_ino);
}

static void wrong_text_is_refused(void **state)
{
    (void)state;
    static char long_line[600], many[SETTINGS_FILE_TEXT + 2];
    memset(long_line, 'x', sizeof long_line - 2);
    long_line[sizeof long_line - 2] = '\n';
    for (size_t i = 0; i < SETTINGS_FILE_TEXT; i += 2)
        memcpy(many + i, "x\n", 2);
    const char *const wrong[] = {"no end", "\n", "a\n\nb\n", "caf\xc3\xa9\n", "a\tb\n", long_line, many};
    begin();
    struct settings_file *file = open_file();
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++)
        assert_int_equal(settings_file_put(file, "head", wrong[i]), SH_EINPUT);
    expect_stored(file, "head", "");
    close_file(file);
}

static const struct {
    const char *text, *says[2];
} bad[] = {
    {"ply\n", {"is no file of stored settings: the first line must be 'scanhead settings 1'", "name another file"}},
    {"scanhead settings 2\nprofile puck\nend\n", {"must be 'scanhead settings 1'", ""}},
    {"scanhead settings 1\n", {":2: the last line 'end' is missing", "remove the file"}},
    {"scanhead settings 1\nprofile other\nend\n", {"of a head of profile other, this is puck", "name another file"}},
    {"scanhead settings 1\nend\n", {":2: there must be 'profile NAME'", ""}},
    {"scanhead settings 1\nprofile puck\nhead HEAD:LINes 15\n", {":4: the last line 'end' is missing", ""}},
    {"scanhead settings 1\nprofile puck\nhead HEAD:LINes 15\nend", {":4: allowed are lines of 1 to 510", ""}},
    {"scanhead settings 1\nprofile puck\nhead\nend\n", {":3: there must be a name, a blank and a setting", ""}},
    {"scanhead settings 1\nprofile puck\n\nend\n", {":3: allowed are lines of 1 to 510 printable", ""}},
    {"scanhead settings 1\nprofile puck\nhead a\x01\nend\n", {":3: allowed are lines", ""}},
    {"scanhead settings 1\nprofile puck\nend\nhead a\n", {":4: nothing may follow 'end'", ""}},
    {"scanhead settings 1\nprofile puck\na-name-of-more-than-31-characters x\nend\n",
     {":3: a-name-of-more-than-31-characters is no name here", "allowed are head and names of protocols"}},
    {"scanhead settings 1\nprofile puck\nHead HEAD:LINes 15\nend\n", {":3: Head is no name here", ""}},
    {"scanhead settings 1\nprofile puck\nhead HEAD:LINes 15\nhead HEAD:LINEs2 1\nhead head:lines 5\nend\n",
     {":5: head:lines 5 is stored twice", "one line for each setting"}},
};

static void expect_refused(const char *text, const char *const says[2])
{
    struct settings_file *file;
    write_text(text);
    const int rc = settings_file_open(path, "puck", NULL, &file, &err);
    if (rc != SH_EINPUT || strstr(err.text, path) == NULL || strstr(err.text, says[0]) == NULL ||
        strstr(err.text, says[1]) == NULL)
        fail_msg("%s%d, %s", text, rc, rc == SH_OK ? "" : err.text);
    struct sh_err said = err;
    assert_int_equal(settings_file_look(path, "puck", &file, &err), SH_EINPUT);
    assert_string_equal(err.text, said.text);
    expect_text(text);
}

static void a_broken_or_foreign_file_is_refused_and_stays(void **state)
{
    (void)state;
    char text[600];
    begin();
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
        expect_refused(bad[i].text, bad[i].says);
    snprintf(text, sizeof text, "scanhead settings 1\nprofile puck\nhead %0479d\nend\n", 0);
    expect_refused(text, (const char *const[]){":3: too long a setting; allowed are 478", ""});
}

static void look(void)
{
    struct settings_file *file;
    if (settings_file_look(path, "puck", &file, &err) != SH_OK) fail_msg("%s", err.text);
    assert_int_equal(settings_file_put(file, "head", "HEAD:LINes 30\n"), SH_OK); /* is kept in memory */
    close_file(file);
}

/* A check of the configuration looks at the file while a head may have it. What is missing, a head makes. */
static void a_check_neither_makes_nor_writes_it(void **state)
{
    (void)state;
    begin();
    look();
    assert_int_equal(access(path, F_OK), -1);
    struct settings_file *file = open_file();
    assert_int_equal(settings_file_put(file, "head", "HEAD:LINes 15\n"), SH_OK);
    look();
    close_file(file);
    look();
    expect_text("scanhead settings 1\nprofile puck\nhead HEAD:LINes 15\nend\n");
    close_file(open_file()); /* nobody has it */
    begin();
}

static void expect_both_refuse(const char *of)
{
    struct settings_file *file;
    char want[200];
    snprintf(want, sizeof want, "head.settings_file: %s: ", of);
    for (int looks = 0; looks < 2; looks++) {
        const int rc =
            looks ? settings_file_look(of, "puck", &file, &err) : settings_file_open(of, "puck", NULL, &file, &err);
        assert_int_equal(rc, SH_EINPUT);
        assert_int_equal(strncmp(err.text, want, strlen(want)), 0);
    }
}

/* A check refuses each path that a head could not write. */
static void a_check_refuses_what_a_head_refuses(void **state)
{
    (void)state;
    char other[160];
    begin();
    snprintf(other, sizeof other, "%s/none", path);
    expect_both_refuse(other); /* no such folder */
    assert_int_equal(mkfifo(path, 0600), 0);
    expect_both_refuse(path);
    begin();
    assert_int_equal(symlink("nothing", path), 0);
    expect_both_refuse(path);
    begin();
    write_text("");
    snprintf(other, sizeof other, "%s.hard", path);
    assert_int_equal(link(path, other), 0);
    expect_both_refuse(path);
    unlink(other);
    begin();
}

/* A file has room for 8 names and for 2047 bytes under each of them. One more is too much. */
static void a_file_has_its_limits(void **state)
{
    (void)state;
    static const char *const names[] = {
        "head", "native", "nmea", "scip", "cola", "velodyne", "velodyne-position", "velodyne-http", "capture"};
    static const char *const too_many[] = {":11: too many names, or too long a name; allowed are 8 of up to 31 bytes",
                                           ""};
    static const char *const too_much[] = {": too much under one name; allowed are 2047 bytes", ""};
    static char text[2 * SETTINGS_FILE_TEXT];
    begin();
    for (int n = 8; n <= 9; n++) {
        size_t len = (size_t)snprintf(text, sizeof text, "scanhead settings 1\nprofile puck\n");
        for (int i = 0; i < n; i++)
            len += (size_t)snprintf(text + len, sizeof text - len, "%s a\n", names[i]);
        snprintf(text + len, sizeof text - len, "end\n");
        if (n == 9) {
            expect_refused(text, too_many);
            continue;
        }
        write_text(text);
        struct settings_file *file = open_file();
        expect_stored(file, "velodyne-http", "a\n");
        close_file(file);
    }
    /* Four lines of 478 characters, and one that fills the rest of 2047 bytes; each has its line end. */
    for (int over = 0; over < 2; over++) {
        size_t len = (size_t)snprintf(text, sizeof text, "scanhead settings 1\nprofile puck\n");
        int left = SETTINGS_FILE_TEXT - 1;
        for (int i = 0; left > 0; i++) {
            const int most = left > 479 ? 478 : left - 1 + over, n = most < 478 ? most : 478;
            len += (size_t)snprintf(text + len, sizeof text - len, "head k%d=%0*d\n", i, n - 3, 0);
            left -= n + 1;
        }
        snprintf(text + len, sizeof text - len, "end\n");
        if (over) {
            expect_refused(text, too_much);
            continue;
        }
        write_text(text);
        close_file(open_file());
    }
}

/* The second head is refused, also after the file was written anew, which gives the file another inode. */
static void two_heads_have_no_file_in_common(void **state)
{
    (void)state;
    struct settings_file *second, *file;
    begin();
    file = open_file();
    for (int i = 0; i < 2; i++) {
        assert_int_equal(settings_file_open(path, "puck", NULL, &second, &err), SH_EINPUT);
        assert_non_null(strstr(err.text, "is being written by"));
        if (i == 1) break;
        struct stat before, after;
        assert_int_equal(stat(path, &before), 0);
        assert_int_equal(settings_file_put(file, "head", "HEAD:LINes 15\n"), SH_OK);
        do /* until the thread has written it; the limit of the program ends a wait for ever */
            assert_int_equal(stat(path, &after), 0);
        while (before.st_ino == after.st_ino);
    }
    close_file(file);
    close_file(open_file());
}

/* Somebody removes the file of a head that runs, and another head makes it anew: it stays the other's. */
static void a_file_of_another_is_not_replaced(void **state)
{
    (void)state;
    begin();
    struct settings_file *first = open_file();
    assert_int_equal(unlink(path), 0);
    struct settings_file *second = open_file();
    assert_int_equal(settings_file_put(second, "head", "HEAD:LINes 5\n"), SH_OK);
    close_file(second);
    assert_int_equal(settings_file_put(first, "head", "HEAD:LINes 15\n"), SH_OK);
    assert_int_equal(settings_file_close(first, &err), SH_ESTATE);
    assert_non_null(strstr(err.text, "was removed or replaced by somebody else"));
    expect_text("scanhead settings 1\nprofile puck\nhead HEAD:LINes 5\nend\n");
    assert_int_equal(access(part, F_OK), -1);
}

/* A killed head has left part of a new file: the old one counts, and the next head takes the part over. */
static void a_killed_writer_leaves_the_old_file(void **state)
{
    (void)state;
    begin();
    write_text("scanhead settings 1\nprofile puck\nhead HEAD:LINes 15\nend\n");
    FILE *left = fopen(part, "w");
    assert_non_null(left);
    fputs("scanhead sett", left);
    fclose(left);
    struct settings_file *file = open_file();
    expect_stored(file, "head", "HEAD:LINes 15\n");
    assert_int_equal(settings_file_put(file, "head", "HEAD:LINes 5\n"), SH_OK);
    close_file(file);
    expect_text("scanhead settings 1\nprofile puck\nhead HEAD:LINes 5\nend\n");
}

static char warning[600];

static void keep_warning(void *ctx, const char *text)
{
    (void)ctx;
    snprintf(warning, sizeof warning, "%s", text);
}

static atomic_int n_warnings;

static void count_warning(void *ctx, const char *text)
{
    (void)ctx;
    (void)text;
    atomic_fetch_add(&n_warnings, 1);
}

/* A folder is in the place of the new file: the writer reports it at once and at the end. The settings stay. */
static void a_failure_to_write_is_said(void **state)
{
    (void)state;
    const struct sh_report report = {.warn = keep_warning};
    struct settings_file *file;
    begin();
    assert_int_equal(mkdir(part, 0700), 0);
    assert_int_equal(settings_file_open(path, "puck", &report, &file, &err), SH_OK);
    assert_int_equal(settings_file_put(file, "head", "HEAD:LINes 5\n"), SH_OK);
    expect_stored(file, "head", "HEAD:LINes 5\n");
    assert_int_not_equal(settings_file_close(file, &err), SH_OK);
    assert_non_null(strstr(err.text, part));
    assert_non_null(strstr(warning, "the settings stored last would be lost without power"));
    expect_text("");
    assert_int_equal(rmdir(part), 0);
}

/* The warning says that the write has failed. Then the failure's reason goes away, and the same text is stored once
 * more. */
static void what_could_not_be_written_is_written_later(void **state)
{
    (void)state;
    const struct sh_report report = {.warn = count_warning};
    struct settings_file *file;
    for (int again = 0; again < 2; again++) {
        begin();
        atomic_store(&n_warnings, 0);
        assert_int_equal(mkdir(part, 0700), 0);
        assert_int_equal(settings_file_open(path, "puck", &report, &file, &err), SH_OK);
        assert_int_equal(settings_file_put(file, "head", "HEAD:LINes 5\n"), SH_OK);
        while (atomic_load(&n_warnings) == 0) /* the limit of the program ends a wait for ever */
            sched_yield();
        assert_int_equal(rmdir(part), 0);
        if (again) { /* by a client, at once */
            struct stat st = {0};
            while (st.st_size == 0) {
                assert_int_equal(settings_file_put(file, "head", "HEAD:LINes 5\n"), SH_OK);
                assert_int_equal(stat(path, &st), 0);
            }
        }
        close_file(file); /* or at the end */
        expect_text("scanhead settings 1\nprofile puck\nhead HEAD:LINes 5\nend\n");
        assert_int_equal(atomic_load(&n_warnings), 1);
    }
}

static void links_and_folders_are_refused(void **state)
{
    (void)state;
    struct settings_file *file;
    begin();
    assert_int_equal(symlink(inner, path), 0);
    assert_int_equal(settings_file_open(path, "puck", NULL, &file, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "symbolic link"));
    begin();
    assert_int_equal(settings_file_open(dir, "puck", NULL, &file, &err), SH_EINPUT);
}

static int make_dir(void **state)
{
    (void)state;
    fd_before = free_fd();
    if (mkdtemp(dir) == NULL) return -1;
    snprintf(path, sizeof path, "%s/set", dir);
    snprintf(part, sizeof part, "%s/set.part", dir);
    snprintf(inner, sizeof inner, "%s/inner", dir);
    return 0;
}

static int remove_dir(void **state)
{
    (void)state;
    unlink(path);
    unlink(part);
    return rmdir(dir) != 0 ? -1 : free_fd_check(fd_before);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_stored_is_there_again),
        cmocka_unit_test(nothing_new_is_not_written),
        cmocka_unit_test(wrong_text_is_refused),
        cmocka_unit_test(a_broken_or_foreign_file_is_refused_and_stays),
        cmocka_unit_test(a_check_neither_makes_nor_writes_it),
        cmocka_unit_test(a_check_refuses_what_a_head_refuses),
        cmocka_unit_test(a_file_has_its_limits),
        cmocka_unit_test(two_heads_have_no_file_in_common),
        cmocka_unit_test(a_file_of_another_is_not_replaced),
        cmocka_unit_test(a_killed_writer_leaves_the_old_file),
        cmocka_unit_test(a_failure_to_write_is_said),
        cmocka_unit_test(what_could_not_be_written_is_written_later),
        cmocka_unit_test(links_and_folders_are_refused),
    };
    return cmocka_run_group_tests(tests, make_dir, remove_dir);
}
