/* SPDX-License-Identifier: MIT */
/* The points so far as a file that a page fetches (`/save`, `/saved`). */
#include <dirent.h>
#include <poll.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include "tests/wire/watch_rig.h"

/* The points after a PLY's header. */
static const char *ply_points(const char *file, size_t len, size_t *n)
{
    static const char last[] = "end_header\n";
    const char *at = memmem(file, len, last, sizeof last - 1);
    assert_non_null(at);
    at += sizeof last - 1;
    *n = len - (size_t)(at - file);
    return at;
}

/* Asks until the file is made, or has failed. Returns the answer. */
static char *save_outcome(const struct head *head)
{
    size_t len;
    char *answer = NULL;
    const int64_t until = wire_now_ms() + DEADLINE_MS;
    do {
        free(answer);
        answer = watch_ask(head, "/save", &len);
        if (wire_now_ms() > until) fail_msg("no file: %s", answer);
    } while (strstr(answer, "\"working\"") != NULL && poll(NULL, 0, 20) == 0);
    return answer;
}

/* The file that a page saves has the bytes that `record` writes of the same scan. */
static void the_points_so_far_are_a_file(void **state)
{
    struct wire *wire = *state;
    char config[256], path[352];
    size_t len, n_saved, n_recorded;
    watch_prepare(wire, config);
    snprintf(path, sizeof path, "%s", wire_path(wire, "whole.ply"));
    free(watch_command(wire, (const char *const[]){"record", config, "-o", path, "--station", "1", "--quiet", NULL},
                       NULL));
    char *recorded = wire_read(path, &len);
    const char *want = ply_points(recorded, len, &n_recorded);
    struct head head = head_start(wire, config, NULL);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    free(watch_scan(&head, sh, 1, 1));
    free(watch_get(&head, "/save?as=ply", &len));
    char *made = save_outcome(&head);
    if (strstr(made, "\"file\":1,") == NULL || strstr(made, "\"lost_frames\":0") == NULL) fail_msg("%s", made);
    free(made);
    char *saved = watch_get(&head, "/saved?file=1&from=0", &len);
    const char *has = ply_points(saved, len, &n_saved);
    assert_int_equal(n_saved, n_recorded);
    assert_memory_equal(has, want, n_saved);
    free(saved);
    char *other = watch_ask(&head, "/saved?file=2&from=0", &len);
    assert_non_null(strstr(other, "file 2 is not there; "));
    assert_int_equal(strncmp(other, "HTTP/1.1 400", 12), 0);
    free(other);
    free(recorded);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

/* How many names a folder has; the last one is in `name`. */
static int n_names(const char *path, char *name, size_t len)
{
    DIR *folder = opendir(path);
    int n = 0;
    assert_non_null(folder);
    for (const struct dirent *entry; (entry = readdir(folder)) != NULL;) {
        if (entry->d_name[0] == '.') continue;
        snprintf(name, len, "%s", entry->d_name);
        n++;
    }
    closedir(folder);
    return n;
}

/* A file of limited length stands for a full disk: the stream fits, the packets with it do not. */
static void a_file_that_fails_leaves_nothing(void **state)
{
    struct wire *wire = *state;
    char config[256], folder[352], name[256], path[700];
    size_t len;
    unsigned long long bytes = 0;
    watch_prepare(wire, config);
    snprintf(folder, sizeof folder, "%s", wire_path(wire, "temporary"));
    assert_int_equal(mkdir(folder, 0700), 0);
    setenv("TMPDIR", folder, 1);
    signal(SIGXFSZ, SIG_IGN); /* a write beyond the limit fails, then, and does not end the head */
    struct head head = head_start(wire, config, NULL);
    signal(SIGXFSZ, SIG_DFL);
    unsetenv("TMPDIR");
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    free(watch_scan(&head, sh, 1, 1));
    free(watch_get(&head, "/save?as=pcapng", &len));
    char *answer = save_outcome(&head);
    const char *at = strstr(answer, "\"bytes\":");
    assert_true(at != NULL && sscanf(at, "\"bytes\":%llu", &bytes) == 1 && bytes > 1000);
    free(answer);
    const struct rlimit less = {bytes - 1, RLIM_INFINITY};
    assert_int_equal(prlimit(head.pid, RLIMIT_FSIZE, &less, NULL), 0);
    free(watch_get(&head, "/save?as=pcapng", &len));
    for (int page = 0; page < 2; page++) { /* each gets the reason */
        answer = save_outcome(&head);
        if (strstr(answer, "points.pcapng") == NULL || strstr(answer, strerror(EFBIG)) == NULL ||
            strstr(answer, " 503 ") == NULL)
            fail_msg("%s", answer);
        free(answer);
    }
    assert_int_equal(n_names(folder, name, sizeof name), 1);
    snprintf(path, sizeof path, "%s/%s", folder, name);
    assert_int_equal(n_names(path, name, sizeof name), 0);
    /* A service that clears old temporary folders removes this one. The next file gets a new one. */
    const struct rlimit none = {RLIM_INFINITY, RLIM_INFINITY};
    assert_int_equal(prlimit(head.pid, RLIMIT_FSIZE, &none, NULL), 0);
    assert_int_equal(rmdir(path), 0);
    free(watch_get(&head, "/save?as=pcapng", &len));
    answer = save_outcome(&head);
    if (strstr(answer, "\"done\"") == NULL) fail_msg("%s", answer);
    free(answer);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    assert_int_equal(n_names(folder, name, sizeof name), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(the_points_so_far_are_a_file, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(a_file_that_fails_leaves_nothing, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests_name("save", tests, NULL, NULL);
}
