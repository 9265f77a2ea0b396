/* SPDX-License-Identifier: MIT */
/* Files that a command writes: none may destroy another, or one that is read. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "core/newfile.h"
#include "firmware_sim/app/app.h"

static char folder[] = "/tmp/scanhead-test-XXXXXX";
static struct sh_err err;

static void add(struct app_input *in, const char *option, const char *path, enum app_use use)
{
    if (path != NULL)
        assert_int_equal(app_add_file(in, &(struct app_file){.option = option, .path = path, .use = use}), APP_OK);
}

static int check(const char *scenario, const char *stats, const char *truth)
{
    struct app_input in = {0};
    add(&in, NULL, "run.yaml", APP_READS);
    add(&in, "scenario", scenario, APP_READS);
    add(&in, "stats", stats, APP_WRITES);
    add(&in, "truth", truth, APP_WRITES);
    err.text[0] = '\0';
    return app_check_files(&in, NULL, &err);
}

static void write_text(const char *name, const char *text)
{
    FILE *out = fopen(name, "w");
    assert_non_null(out);
    fputs(text, out);
    fclose(out);
}

static int go_there(void **state)
{
    (void)state;
    return mkdtemp(folder) == NULL || chdir(folder) != 0;
}

static int come_back(void **state)
{
    (void)state;
    return chdir("/") != 0 || rmdir(folder) != 0;
}

static void files_are_apart(void **state)
{
    (void)state;
    assert_int_equal(check("lossy-udp", "a", "a"), SH_EINPUT); /* not there yet */
    assert_string_equal(err.text, "--truth a: --stats writes the same file; name another one");
    assert_int_equal(check("lossy-udp", "a", "./a"), SH_EINPUT); /* two names of what is not there yet */
    assert_string_equal(err.text, "--truth ./a: --stats writes the same file; name another one");
    char whole[sizeof folder + 8];
    snprintf(whole, sizeof whole, "%s/a", folder);
    assert_int_equal(check("lossy-udp", "sub/../a", whole), SH_OK); /* no such folder: can't be made */
    assert_int_equal(mkdir("sub", 0700), 0);
    assert_int_equal(check("lossy-udp", "sub/../a", whole), SH_EINPUT);
    assert_int_equal(check("lossy-udp", "sub/a", "a"), SH_OK);
    assert_int_equal(rmdir("sub"), 0);
    assert_int_equal(check("lossy-udp", "lossy-udp", NULL), SH_OK); /* the scenario is no file here */
    assert_int_equal(check("lossy-udp", "-", "-"), SH_EINPUT);      /* standard output */
    assert_string_equal(err.text, "--truth -: --stats writes the same file; name another one");
    assert_int_equal(check("-", "-", NULL), SH_OK); /* standard input and output */
    write_text("a", "");
    write_text("run.yaml", "");
    assert_int_equal(check(NULL, "a", "./a"), SH_EINPUT);
    assert_int_equal(check(NULL, NULL, "./run.yaml"), SH_EINPUT);
    assert_string_equal(
        err.text,
        "--truth ./run.yaml: is also read as the operand run.yaml, and would be overwritten; name another file");
    assert_int_equal(check("a", "./a", NULL), SH_EINPUT);
    assert_int_equal(link("a", "b"), 0);
    assert_int_equal(check("a", "b", NULL), SH_EINPUT);
    unlink("b");
    assert_int_equal(symlink("a", "b"), 0);
    assert_int_equal(check("b", "a", NULL), SH_EINPUT);
    unlink("b");
    assert_int_equal(check("lossy-udp", "a", "b"), SH_OK);
    assert_int_equal(check(NULL, "/dev/null", "/dev/null"), SH_OK);
    assert_int_equal(mkfifo("fifo", 0600), 0);
    assert_int_equal(check(NULL, "fifo", "fifo"), SH_OK);
    assert_int_equal(check(NULL, NULL, NULL), SH_OK);
    unlink("fifo");
    unlink("a");
    unlink("run.yaml");
}

/* Files of single scans are known by the pattern of their names, and sidecars by their endings. */
static void files_beside_a_file(void **state)
{
    (void)state;
    static const struct {
        const char *other;
        int rc;
    } cases[] = {{"x.obj", SH_EINPUT},      {"./x-12.obj", SH_EINPUT},   {"x-.obj", SH_OK},   {"x-1.ply", SH_OK},
                 {"x.mtl", SH_EINPUT},      {"x-3.mtl", SH_EINPUT},      {"x-3a.mtl", SH_OK}, {"y-3.mtl", SH_OK},
                 {"x.obj.part", SH_EINPUT}, {"x-7.obj.part", SH_EINPUT}, {"x.part", SH_OK},   {"y.obj.part", SH_OK}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct app_input in = {0};
        struct app_file file = {.option = "output", .path = "x.obj", .use = APP_WRITES, .n_ending = 4, .each = 1};
        assert_int_equal(app_add_file(&in, &file), APP_OK);
        file.ending = ".mtl";
        assert_int_equal(app_add_file(&in, &file), APP_OK);
        file.ending = NULL;
        file.added = ".part";
        assert_int_equal(app_add_file(&in, &file), APP_OK);
        add(&in, "stats", cases[i].other, APP_WRITES);
        if (app_check_files(&in, NULL, &err) != cases[i].rc) fail_msg("%s: not %d", cases[i].other, cases[i].rc);
    }
}

/* A link is not followed when the file is made, which may be after hours. So an option that names one is refused at
 * once. The system's own links lead to open files. */
static void links(void **state)
{
    (void)state;
    static const struct {
        const char *path;
        enum app_use use;
        int is_given, rc;
    } cases[] = {
        {"link", APP_WRITES, 1, SH_EINPUT}, {"link", APP_READS, 1, SH_OK},         {"link", APP_WRITES, 0, SH_OK},
        {"other", APP_WRITES, 1, SH_OK},    {"/dev/stdout", APP_WRITES, 1, SH_OK}, {"/dev/fd/1", APP_WRITES, 1, SH_OK},
        {"-", APP_WRITES, 1, SH_OK}};
    assert_int_equal(symlink("nowhere", "link"), 0);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct app_input in = {0};
        const struct app_file file = {
            .option = "stats", .path = cases[i].path, .use = cases[i].use, .is_given = cases[i].is_given};
        assert_int_equal(app_add_file(&in, &file), APP_OK);
        err.text[0] = '\0';
        if (app_check_files(&in, NULL, &err) != cases[i].rc) fail_msg("%zu: %s", i, err.text);
        if (cases[i].rc == SH_OK) continue;
        assert_string_equal(err.text, "--stats link: is a symbolic link to nowhere; links are not followed: remove it, "
                                      "or give its target");
    }
    assert_int_equal(unlink("link"), 0);
}

/* Returns the result for a file that --stats names, and how it is used. */
static int check_one(const char *path, enum app_use use)
{
    struct app_input in = {0};
    const struct app_file file = {.option = "stats", .path = path, .use = use, .is_given = 1};
    assert_int_equal(app_add_file(&in, &file), APP_OK);
    err.text[0] = '\0';
    return app_check_files(&in, NULL, &err);
}

/* A file that is filled may be opened only after hours. So it is tried at once, and nothing in it changes. A FIFO may
 * still get its reader. */
static void files_that_are_filled(void **state)
{
    (void)state;
    static const char *const allowed[] = {"new", "old", "fifo", "-", "/dev/full", "/dev/stdout"};
    struct sockaddr_un name = {.sun_family = AF_UNIX, .sun_path = "socket"};
    char longest[NAME_MAX + 2];
    int fd;
    memset(longest, 'n', sizeof longest - 1);
    longest[sizeof longest - 1] = '\0';
    write_text("old", "text");
    write_text("linked", "");
    assert_int_equal(link("linked", "also"), 0);
    assert_int_equal(mkfifo("fifo", 0600), 0);
    const int socket_fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    assert_int_equal(bind(socket_fd, (const struct sockaddr *)&name, sizeof name), 0);
    for (size_t i = 0; i < sizeof allowed / sizeof allowed[0]; i++)
        if (check_one(allowed[i], APP_FILLS) != SH_OK) fail_msg("%s: %s", allowed[i], err.text);
    struct stat st;
    assert_true(stat("old", &st) == 0 && st.st_size == 4 && stat("new", &st) != 0);
    assert_int_equal(check_one("linked", APP_WRITES), SH_OK); /* it is replaced, and the other name keeps its file */
    assert_int_equal(check_one("linked", APP_FILLS), SH_EINPUT);
    assert_string_equal(err.text, "--stats linked: is a file with 2 hard links, and all of them would change; remove "
                                  "it first");
    assert_int_equal(check_one("socket", APP_FILLS), SH_EINPUT);
    assert_string_equal(err.text, "--stats socket: is a socket; allowed are a regular file, a device and a FIFO");
    assert_int_equal(check_one(longest, APP_FILLS), SH_EINPUT);
    assert_non_null(strstr(err.text, ": File name too long"));
    assert_int_equal(newfile_open("old", &fd, &err), SH_OK); /* by another writer */
    assert_int_equal(check_one("old", APP_FILLS), SH_EINPUT);
    assert_non_null(strstr(err.text, "--stats old: is being written by "));
    close(fd);
    close(socket_fd);
    static const char *const made[] = {"old", "linked", "also", "fifo", "socket"};
    for (size_t i = 0; i < sizeof made / sizeof made[0]; i++)
        assert_int_equal(unlink(made[i]), 0);
}

/* The files that a mesh names are read, too. */
static void files_of_a_mesh(void **state)
{
    (void)state;
    struct app_input in = {0};
    write_text("m.obj", "mtllib m.mtl\nv 0.5 0 0\n");
    write_text("m.mtl", "newmtl a\nmap_Kd m.png\n");
    write_text("m.png", "");
    add(&in, NULL, "m.obj", APP_READS);
    add(&in, "output", "./m.png", APP_WRITES);
    assert_int_equal(app_check_files(&in, NULL, &err), SH_EINPUT);
    assert_string_equal(
        err.text, "--output ./m.png: is also read as m.png, named in the operand m.obj, and would be overwritten; "
                  "name another file");
    struct app_input turned = {0}; /* in whatever order */
    add(&turned, "output", "./m.png", APP_WRITES);
    add(&turned, NULL, "m.obj", APP_READS);
    assert_int_equal(app_check_files(&turned, NULL, &err), SH_EINPUT);
    unlink("m.png");
    assert_int_equal(app_check_files(&in, NULL, &err), SH_OK); /* it isn't there */
    unlink("m.obj");
    unlink("m.mtl");
}

/* A name has blanks, and is written in another case than its file. The name's end is another file: the reader prefers
 * the longer name, so that file is read. */
static void names_with_blanks(void **state)
{
    (void)state;
    static const struct {
        const char *map, *reads, *other;
    } rows[] = {{"My Wood.png", "my wood.png", "Wood.png"},
                {"My%20Wood.png", "my wood.png", "Wood.png"},
                {"C:\\tex\\My Wood.png", "my wood.png", "Wood.png"},
                {"Tex Tures/Wood.png", "tex tures/wood.png", "Tures"},
                {"-s 1 1 Wood.png", "wood.png", "1.png"}};
    assert_int_equal(mkdir("tex tures", 0700), 0);
    write_text("m.obj", "mtllib m.mtl\nv 0.5 0 0\n");
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct app_input in = {0};
        char text[128];
        snprintf(text, sizeof text, "newmtl a\nmap_Kd %s\n", rows[i].map);
        write_text("m.mtl", text);
        write_text(rows[i].reads, "");
        write_text(rows[i].other, "");
        add(&in, NULL, "m.obj", APP_READS);
        add(&in, "output", rows[i].reads, APP_WRITES);
        if (app_check_files(&in, NULL, &err) != SH_EINPUT) fail_msg("%s", rows[i].map);
        unlink(rows[i].reads);
        unlink(rows[i].other);
    }
    unlink("m.obj");
    unlink("m.mtl");
    assert_int_equal(rmdir("tex tures"), 0);
}

/* Each option that names a file says whether it is read or written; otherwise it would not be compared. */
static void options_say_what_their_files_are(void **state)
{
    (void)state;
    static const struct app_command *const commands[] = {&app_run,    &app_record,   &app_plan, &app_map,
                                                         &app_report, &app_check,    &app_list, &app_init,
                                                         &app_batch,  &app_coverage, &app_view, &app_soak};
    for (size_t i = 0; i < sizeof commands / sizeof commands[0]; i++)
        for (const struct app_option *row = commands[i]->options; row->kind != APP_LAST; row++)
            if (row->argument != NULL &&
                (strstr(row->argument, "FILE") != NULL || strcmp(row->argument, "CONFIG") == 0) &&
                row->file == APP_NO_FILE)
                fail_msg("%s --%s names a file, and its row doesn't say whether it is read", commands[i]->name,
                         row->name);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(files_are_apart),
                                       cmocka_unit_test(files_beside_a_file),
                                       cmocka_unit_test(links),
                                       cmocka_unit_test(files_that_are_filled),
                                       cmocka_unit_test(files_of_a_mesh),
                                       cmocka_unit_test(names_with_blanks),
                                       cmocka_unit_test(options_say_what_their_files_are)};
    return cmocka_run_group_tests(tests, go_there, come_back);
}
